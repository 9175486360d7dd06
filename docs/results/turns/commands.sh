#!/bin/sh
# castle-P30 of Strecha et al., freiburg3_long_office_household of TUM RGB-D and redkitchen of 7-Scenes, imported as castle, tum and kitchen
# (docs/results says how); kitchen231 is `matchbench import 7scenes redkitchen kitchen231 --pairs window:21,stride:7`.
set -e
# One hypothesis, and no pair is given up. Without turns there is one hypothesis.
settings() {
    echo "--set adaptive.hopeless=0 --set adaptive.turns=$1"
    [ $1 = false ] || echo "--set adaptive.hypotheses=1"
}
for scene in office-wide object-wide cabinet-wide facade; do
    matchbench import rendered $scene $scene
done
for turns in true false; do
    matchbench run tum kitchen --matchers all --estimator adaptive $(settings $turns) --repeat 5 --out runs/small-$turns
    matchbench run castle --matchers all --estimator adaptive $(settings $turns) --repeat 5 --out runs/castle-$turns
    matchbench run kitchen231 office-wide object-wide cabinet-wide facade --matchers sift,surf,akaze,orb,kaze --estimator adaptive,best \
        $(settings $turns) --set best.turns=$turns --repeat 3 --out runs/tuning-$turns
done
matchbench compare runs/small-false runs/small-true
