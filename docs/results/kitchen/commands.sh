#!/bin/sh
# 150 consecutive frames of the scene redkitchen of 7-Scenes: every fifteenth, and all pairs of these ten.
set -e
matchbench import 7scenes redkitchen kitchen --pairs window:9,stride:15
# Both scenes were one run, `matchbench run tum kitchen --matchers all ...`, of which plan and scores have the part of this one: nothing differs.
matchbench run kitchen --matchers all --estimator ransac-e,rich,best,adaptive --repeat 5 --out runs/kitchen
matchbench eval runs/kitchen --format csv > scores.csv
cp runs/kitchen/plan.json plan.json # the paths of datasets in it were shortened by hand
