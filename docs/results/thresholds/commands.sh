#!/bin/sh
# castle-P30 of Strecha et al., freiburg3_long_office_household of TUM RGB-D, redkitchen of 7-Scenes and KITTI 06, as their
# authors publish them, imported as castle, tum and kitti (docs/results says how), and kitchen231 by
# `matchbench import 7scenes redkitchen kitchen231 --pairs window:21,stride:7`.
set -e
for scene in office-wide object-wide cabinet-wide facade; do
    matchbench import rendered $scene $scene
done
for threshold in 0.5 1 2 4; do
    matchbench run tum --matchers sift,orb,akaze,rootsift --estimator best,adaptive --repeat 5 \
        --set best.threshold_px=$threshold --set adaptive.threshold_px=$threshold --out runs/tum-$threshold
    matchbench run tum --matchers sift,orb,akaze,rootsift --estimator adaptive --repeat 5 --set adaptive.turns=false \
        --set adaptive.threshold_px=$threshold --out runs/points-$threshold
    matchbench eval runs/tum-$threshold
    matchbench eval runs/points-$threshold
done
tune() { # ESTIMATOR NAME [OPTIONS]
    id=$1 name=$2
    shift 2
    matchbench tune kitchen231 kitti office-wide object-wide cabinet-wide facade --matchers sift,orb,akaze,kaze \
        --parameter $id.threshold_px --values 0.5,1,2,4 --repeat 2 "$@" --out tuning/$name
}
tune best best
tune adaptive adaptive
tune adaptive points-alone --set adaptive.turns=false
matchbench run castle --matchers sift,rootsift,orb,akaze --estimator best,adaptive --repeat 5 --out runs/castle
matchbench eval runs/castle
