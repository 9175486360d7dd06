#!/bin/sh
# Makes any program that prints matches a matcher of matchbench, without Python:
#
#   PROGRAM [ARGUMENTS] IMAGE_A IMAGE_B
#
# prints a line `x_a y_a x_b y_b [ambiguity]` for each match: pixels of the original images with the
# centre of the first pixel at 0, ambiguity from 0 (certain, the default) to 1. It is started for
# each pair, so it should start quickly. Perl writes the numbers as bytes. A line that is no match fails the pair.
set -u

# Perl reads any text as a number, so each word is looked at.
PACK='my @n = split;
@n == 4 || @n == 5 and !grep { !/^[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$/ } @n
    or die "line $. is not `x_a y_a x_b y_b [ambiguity]`: $_";
print pack("f<5", @n[0..3], $n[4] // 0);'

# What matches depend on besides the program: its arguments, and the contents of those that are files.
arguments() {
    shift
    for argument; do
        printf '%s\n' "$argument"
        if [ -f "$argument" ]; then cksum <"$argument"; fi
    done
}

field() { printf '%s\n' "$line" | sed -n "s/.*\"$1\":\"\([^\"]*\)\".*/\1/p"; }

while IFS= read -r line; do
    case $line in
    *'"type":"hello"'*'"params":{}'*)
        # A program that was changed is another version, and so are other arguments.
        version=$(cksum <"$(command -v "$1")" 2>/dev/null | tr ' ' -)
        version=${version:-unknown}
        if [ $# -gt 1 ]; then version=$version+$(arguments "$@" | cksum | tr ' ' -); fi
        printf '{"type":"ready","protocol":1,"name":"%s","version":"%s","pixel_center":0}\n' \
            "${1##*/}" "$version"
        ;;
    *'"type":"hello"'*)
        printf '{"type":"refused","reason":"%s"}\n' \
            "a program has no parameters; take [params] out of the manifest, and give arguments in its command"
        exit 0
        ;;
    *'"type":"match"'*)
        pair=$(printf '%s\n' "$line" | sed -n 's/.*"pair":\(\[[0-9]*,[0-9]*\]\).*/\1/p')
        out=$(field out)
        if "$@" "$(field a)" "$(field b)" </dev/null >"$out.txt" &&
            perl -ne "$PACK" <"$out.txt" >"$out"; then
            count=$(($(wc -c <"$out") / 20))
            printf '{"type":"matched","pair":%s,"count":%d}\n' "$pair" "$count"
        else
            printf '{"type":"failed","pair":%s,"reason":"%s failed"}\n' "$pair" "${1##*/}"
        fi
        rm -f "$out.txt"
        ;;
    *'"type":"bye"'*) exit 0 ;;
    esac
done
