#!/bin/sh
# castle-P30 of Strecha et al. (30 images of 3072 x 2048) in a folder `castle-P30`, as its authors publish it.
set -e
matchbench import strecha castle-P30 castle
matchbench run castle --matchers all --repeat 5 --out runs/castle \
    --estimator ransac-e,rich,best,adaptive,prosac-e,lo-ransac-e,mlesac-e,magsac-e,lmeds-e,ransac-f,usac-f,lmeds-f
matchbench eval runs/castle --format csv > scores.csv
cp runs/castle/plan.json plan.json # the paths of datasets in it were shortened by hand
matchbench report runs/castle # its figure `estimators-castle` is docs/estimators.png
