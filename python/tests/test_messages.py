"""Messages of the library call options as Python does, and not as the command line."""

import re

import matchbench as mb
import pytest
from matchbench._native import command_line


def told(call, kind=mb.Error):
    """What the call is refused with, in which no option of the command line is named."""
    with pytest.raises(kind) as caught:
        call()
    message = str(caught.value)
    assert not re.search(r"(^|[ (`])--[a-z]", message), message
    return message


def test_files_of_matches_are_described_by_arguments(dataset, tmp_path):
    def run(**options):
        files = mb.MatchesFrom("x", tmp_path / "txt", **options)
        return lambda: mb.run(dataset, files, out=tmp_path / "run", progress=False)

    pair = tmp_path / "txt" / "_".join(dataset.images[frame].stem for frame in (0, 1))
    pair.parent.mkdir()
    pair.with_suffix(".txt").write_text("900 10 10 10\n")
    message = told(run())
    assert message.endswith("; say pixel_center=0 (as OpenCV, numpy indices) or 0.5 (as COLMAP)"), message
    assert told(run(verified=True)).endswith("leave verified out")
    assert told(run(format="npz")).endswith("leave format out, or name the right files")
    outside = 'say resized="WxH"; if the first pixel\'s centre is elsewhere say pixel_center'
    assert told(run(pixel_center=0)).endswith(outside)
    assert told(run(pixel_center=0, resized="320x240")).endswith("say pixel_center")
    pair.with_suffix(".txt").write_text("1 1 10 10\n")
    with pytest.warns(UserWarning, match='resized images\\? Then say resized="WxH"'):
        run(pixel_center=0)()


def test_other_options_are_arguments_too(dataset, tmp_path):
    def imported(kind, source, **options):
        return lambda: mb.import_dataset(kind, source, tmp_path / "out", **options)

    assert told(imported("tum", tmp_path, image_root=tmp_path)).startswith("image_root: kind tum has no such option")
    assert told(imported("rendered", "cabinet", images="copy")).startswith("images: a rendered scene")

    def run(estimator, protocols=()):
        return lambda: mb.run(
            dataset, "orb", estimator, protocols=protocols, out=tmp_path / "run", limit=1, progress=False
        )

    assert "choose one of poses (best, ransac-e ...) with estimators, and" in told(run("best-h"))
    run("best")()
    assert 'protocols=["matchbench", "superglue"]` has both' in told(run(None, "superglue"))
    mb.run(dataset, ["gms", "sift"], out=tmp_path / "own", limit=2, progress=False)
    (verdict,) = mb.evaluate(tmp_path / "own").verdicts
    assert verdict.endswith("compares estimators too: give all the same estimators"), verdict


def test_commands_speak_of_their_options(dataset, capfd, tmp_path):
    matches = tmp_path / "txt"
    matches.mkdir()
    (matches / "0_1.txt").write_text("1 1 1 1\n")
    words = ["matchbench", "run", str(dataset.path), "--matches", f"x={matches}", "--out", str(tmp_path / "run")]
    assert command_line(words) != 0
    assert "say --pixel-center 0 (as" in capfd.readouterr().err
    # Afterwards, Python again.
    message = told(lambda: mb.run(dataset, mb.MatchesFrom("x", matches), out=tmp_path / "run", progress=False))
    assert "say pixel_center=0" in message
