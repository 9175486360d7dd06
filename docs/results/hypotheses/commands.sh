#!/bin/sh
# freiburg3_long_office_household of TUM RGB-D, castle-P30 of Strecha et al. and redkitchen of 7-Scenes, imported as tum, castle and kitchen231
# (docs/results says how); kitchen231 is `matchbench import 7scenes redkitchen kitchen231 --pairs window:21,stride:7`.
set -e
for scene in office-wide object-wide cabinet-wide facade; do
    matchbench import rendered $scene $scene
done
ids=sift,rootsift,dsp-sift,surf,orb,brisk,kaze,akaze,freak-sift,gms,adalam
for n in 1 8; do
    matchbench run tum --matchers $ids --estimator adaptive --set adaptive.hypotheses=$n --set adaptive.hopeless=0 --repeat 5 --out runs/tum-$n
    matchbench run castle --matchers $ids --estimator adaptive --set adaptive.hypotheses=$n --set adaptive.hopeless=0 --repeat 5 --out runs/castle-$n
    matchbench run kitchen231 office-wide object-wide cabinet-wide facade --matchers sift,rootsift,surf,orb,akaze --estimator adaptive \
        --set adaptive.hypotheses=$n --set adaptive.hopeless=0 --repeat 5 --out runs/tuning-$n
done
matchbench compare runs/tum-1 runs/tum-8
matchbench compare runs/castle-1 runs/castle-8
matchbench compare runs/tuning-1 runs/tuning-8
