#!/bin/sh
# The scene of kitchen/ once more, with the poses of its colour camera. 150 consecutive frames of the scene redkitchen of 7-Scenes.
set -e
# Where the colour camera is, from every seventh frame: the warning of eval has the numbers.
matchbench import 7scenes redkitchen kitchen231 --pairs window:21,stride:7
matchbench run kitchen231 --matchers sift,rootsift,adalam --estimator best --out runs/place
matchbench eval runs/place
cat > camera-on-body.txt <<'NUMBERS'
0.9990 -0.0305 0.0320 0.0223
0.0283 0.9974 0.0668 -0.1353
-0.0339 -0.0659 0.9973 0.1940
NUMBERS
# Every fifteenth frame, and all pairs of these ten.
matchbench import 7scenes redkitchen kitchen --pairs window:9,stride:15 --body-from-camera camera-on-body.txt
matchbench run kitchen --matchers all --estimator ransac-e,rich,best,adaptive --repeat 5 --out runs/kitchen
matchbench eval runs/kitchen --format csv > scores.csv
cp runs/kitchen/plan.json plan.json # the path of the dataset in it was shortened by hand
# Beside a reconstruction from every third frame; given/kitchen is the same dataset imported without --body-from-camera.
matchbench import 7scenes redkitchen frames --pairs window:1,stride:3
compare/.venv/bin/python compare/reconstruct.py frames kitchen reconstruction
mkdir placed given
mv kitchen placed/kitchen
matchbench import 7scenes redkitchen given/kitchen --pairs window:9,stride:15
matchbench eval reconstruction --datasets given
matchbench eval reconstruction --datasets placed
