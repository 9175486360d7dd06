#!/bin/sh
# castle-P30 of Strecha et al.; the wall is the dataset of 448 images that compare/scale.py makes.
set -e
matchbench import strecha castle-P30 castle
python3 -c 'from pathlib import Path; from scale import dataset; dataset(Path("wall"), 448)' # in compare/
python3 compare/threads.py target/release/matchbench castle --repeats 2 --apart 16
python3 compare/threads.py target/release/matchbench wall --matchers orb --repeats 2 --apart 0
