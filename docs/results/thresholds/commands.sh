#!/bin/sh
# castle-P30 of Strecha et al., freiburg3_long_office_household of TUM RGB-D, redkitchen of 7-Scenes and KITTI 06, as their
# authors publish them, imported as castle, tum, kitchen and kitti-06 (docs/results says how).
set -e
for scene in office-wide object-wide cabinet-wide facade; do
    matchbench import rendered $scene $scene
done
for threshold in 0.5 1 2 4; do
    matchbench run tum --matchers sift,orb,akaze,rootsift --estimator best,adaptive --repeat 5 \
        --set best.threshold_px=$threshold --set adaptive.threshold_px=$threshold --out runs/tum-$threshold
    matchbench eval runs/tum-$threshold
done
for estimator in best adaptive; do
    matchbench tune kitchen kitti-06 office-wide object-wide cabinet-wide facade --matchers sift,orb,akaze,kaze \
        --parameter $estimator.threshold_px --values 0.5,1,2,4 --repeat 2 --out tuning/$estimator
done
matchbench run castle --matchers sift,rootsift,orb,akaze --estimator best,adaptive --repeat 5 --out runs/castle
matchbench eval runs/castle
