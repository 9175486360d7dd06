#!/bin/sh
# Image 0 and 1 of TUM freiburg3_long_office_household (640 x 480) and of castle-P30 (3072 x 2048), and castle as a dataset.
set -e
cargo build --release --workspace
matchbench import strecha castle-P30 castle
python compare/speed.py office/0.png office/1.png castle-P30/images/0000.jpg castle-P30/images/0001.jpg \
    --dataset castle --repeats 5 --out docs/results/speed-intel-amx
