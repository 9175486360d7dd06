#!/bin/sh
# castle-P30 of Strecha et al. (30 images of 3072 x 2048), freiburg3_long_office_household of TUM RGB-D and redkitchen of
# 7-Scenes, as their authors publish them. The adapters need what their requirements.txt name.
set -e
matchbench import tum rgbd_dataset_freiburg3_long_office_household tum --pairs all
matchbench import 7scenes redkitchen kitchen --pairs window:9,stride:15
matchbench import strecha castle-P30 castle
pip install -r adapters/aliked-lightglue/requirements.txt -r adapters/xfeat/requirements.txt
matchbench run tum kitchen castle --matchers adapters/aliked-lightglue/aliked-lightglue.toml,adapters/xfeat/xfeat.toml \
    --estimator ransac-e,best,adaptive --repeat 5 --out runs/learned
matchbench eval runs/learned --format csv > scores.csv
cp runs/learned/plan.json plan.json # the paths in it were shortened by hand
