#!/bin/sh
# 20 frames of the TUM sequence freiburg3_long_office_household: images 0, 30, 60 ... 480 of its rgb.txt and 101, 201,
# 297, with rgb.txt cut to these lines; 19 of them have a pose.
set -e
matchbench import tum rgbd_dataset_freiburg3_long_office_household tum --pairs all
# Both scenes were one run, `matchbench run tum kitchen --matchers all ...`, of which plan and scores have the part of this one: nothing differs.
matchbench run tum --matchers all --estimator ransac-e,rich,best,adaptive --repeat 5 --out runs/tum
matchbench eval runs/tum --format csv > scores.csv
cp runs/tum/plan.json plan.json # the paths of datasets in it were shortened by hand
