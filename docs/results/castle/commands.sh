#!/bin/sh
# castle-P30 of Strecha et al. (30 images of 3072 x 2048) in a folder `castle-P30`, as its authors publish it.
set -e
matchbench import strecha castle-P30 castle
matchbench run castle --matchers all --estimator ransac-e,rich,best,adaptive --repeat 5 --out runs/castle
matchbench eval runs/castle --format csv > scores.csv
cp runs/castle/plan.json plan.json # the paths of datasets in it were shortened by hand
