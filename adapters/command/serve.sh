#!/bin/sh
# Makes any program that prints matches a matcher of matchbench, without Python:
#
#   PROGRAM [ARGUMENTS] IMAGE_A IMAGE_B
#
# prints a line `x_a y_a x_b y_b [ambiguity]` for each match: pixels of the original images with the
# centre of the first pixel at 0, ambiguity from 0 (certain, the default) to 1. It is started for
# each pair, so it should start quickly. Perl writes the numbers as bytes.
set -u

field() { printf '%s\n' "$line" | sed -n "s/.*\"$1\":\"\([^\"]*\)\".*/\1/p"; }

while IFS= read -r line; do
    case $line in
    *'"type":"hello"'*)
        # A program that was changed is another version.
        version=$(cksum <"$(command -v "$1")" 2>/dev/null | tr ' ' -)
        printf '{"type":"ready","protocol":1,"name":"%s","version":"%s","pixel_center":0}\n' \
            "${1##*/}" "${version:-unknown}"
        ;;
    *'"type":"match"'*)
        pair=$(printf '%s\n' "$line" | sed -n 's/.*"pair":\(\[[0-9]*,[0-9]*\]\).*/\1/p')
        out=$(field out)
        if "$@" "$(field a)" "$(field b)" </dev/null >"$out.txt" &&
            perl -ane 'print pack("f<5", @F[0..3], $F[4] // 0)' <"$out.txt" >"$out"; then
            count=$(($(wc -l <"$out.txt")))
            printf '{"type":"matched","pair":%s,"count":%d}\n' "$pair" "$count"
        else
            printf '{"type":"failed","pair":%s,"reason":"%s failed"}\n' "$pair" "${1##*/}"
        fi
        rm -f "$out.txt"
        ;;
    *'"type":"bye"'*) exit 0 ;;
    esac
done
