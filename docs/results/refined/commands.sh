#!/bin/sh
# freiburg3_long_office_household of TUM RGB-D and castle-P30 of Strecha et al., imported as tum and castle (docs/results says how).
set -e
refined() { for id in "$@"; do echo "--set $id.refine=true"; done; }
all="sift rootsift surf orb brisk akaze adalam adalam-asift"
for scene in object-wide office-wide facade; do
    matchbench import rendered $scene $scene
done
matchbench run tum --matchers "$(echo $all | tr ' ' ,)" --estimator ransac-e,best --repeat 5 --out runs/tum-plain
matchbench run tum --matchers "$(echo $all | tr ' ' ,)" --estimator ransac-e,best --repeat 5 $(refined $all) --out runs/tum-refined
matchbench run castle --matchers sift,orb --estimator ransac-e,best --repeat 5 --out runs/castle-plain
matchbench run castle --matchers sift,orb --estimator ransac-e,best --repeat 5 $(refined sift orb) --out runs/castle-refined
matchbench run object-wide office-wide facade --matchers sift,orb,akaze --estimator ransac-e,best --repeat 5 --out runs/rendered-plain
matchbench run object-wide office-wide facade --matchers sift,orb,akaze --estimator ransac-e,best --repeat 5 $(refined sift orb akaze) --out runs/rendered-refined
matchbench compare runs/tum-plain runs/tum-refined
matchbench compare runs/castle-plain runs/castle-refined
matchbench compare runs/rendered-plain runs/rendered-refined
matchbench import kitti odometry kitti --sequence 06
matchbench import 7scenes redkitchen kitchen231 --pairs window:21,stride:7
for scene in kitti kitchen231; do
    matchbench run $scene --matchers sift,orb,akaze --estimator ransac-e,best --repeat 5 --out runs/$scene-plain
    matchbench run $scene --matchers sift,orb,akaze --estimator ransac-e,best --repeat 5 $(refined sift orb akaze) --out runs/$scene-refined
    matchbench compare runs/$scene-plain runs/$scene-refined
done
matchbench import oxford oxford oxf
matchbench run oxf --matchers sift,orb,akaze --estimator ransac-h,best-h --repeat 5 --out runs/oxf-plain
matchbench run oxf --matchers sift,orb,akaze --estimator ransac-h,best-h --repeat 5 $(refined sift orb akaze) --out runs/oxf-refined
matchbench compare runs/oxf-plain runs/oxf-refined
adaptive() { # SCENES IDS NAME
    matchbench run $1 --matchers $2 --estimator adaptive --repeat 5 --out runs/$3-adaptive-plain
    matchbench run $1 --matchers $2 --estimator adaptive --repeat 5 $(refined $(echo $2 | tr , ' ')) --out runs/$3-adaptive-refined
    matchbench compare runs/$3-adaptive-plain runs/$3-adaptive-refined
}
adaptive tum "$(echo $all | tr ' ' ,)" tum
adaptive kitti sift,orb,akaze kitti
adaptive kitchen231 sift,orb,akaze kitchen231
adaptive castle sift,orb,adalam castle
adaptive "object-wide office-wide facade" sift,orb,akaze rendered
matchbench run castle --matchers adalam --estimator ransac-e,best --repeat 5 --out runs/adalam-plain
matchbench run castle --matchers adalam --estimator ransac-e,best --repeat 5 $(refined adalam) --out runs/adalam-refined
matchbench compare runs/adalam-plain runs/adalam-refined
# With the program that makes sums over windows in whole vectors.
matchbench run castle --matchers adalam-asift --estimator ransac-e,best,adaptive --repeat 5 --set adalam-asift.refine=true --out runs/adalam-asift-refined
matchbench run castle --matchers adalam-asift --estimator ransac-e,best,adaptive --repeat 5 --out runs/adalam-asift-plain
matchbench compare runs/adalam-asift-plain runs/adalam-asift-refined
