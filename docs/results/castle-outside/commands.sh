#!/bin/sh
# castle-P30 of Strecha et al. (30 images of 3072 x 2048); the adapter needs what its requirements.txt names.
# The rows of sift, asift and repmatch have the scores of the first repetition of ../castle; this run took over records of an earlier run of it.
set -e
matchbench import strecha castle-P30 castle
pip install -r adapters/aliked-lightglue/requirements.txt
matchbench run castle --matchers adapters/aliked-lightglue/aliked-lightglue.toml,sift,asift,repmatch \
    --estimator ransac-e,best --out runs/outside
matchbench eval runs/outside --format csv > scores.csv
cp runs/outside/plan.json plan.json # the paths in it were shortened by hand
