#!/bin/sh
# castle-P30 of Strecha et al. (30 images of 3072 x 2048) in a folder `castle-P30`, as its authors publish it.
set -e
matchbench import strecha castle-P30 castle
matchbench run castle --matchers kvld,gaim,asift,code,repmatch \
    --estimator ransac-e,best,lmeds-e,lmeds-f,lo-ransac-e,magsac-e,mlesac-e,prosac-e,ransac-f,rich,usac-f --repeat 5 --out runs/castle-estimators-rest
matchbench eval runs/castle-estimators-rest --format csv > scores.csv
cp runs/castle-estimators-rest/plan.json plan.json # the paths of datasets in it were shortened by hand
