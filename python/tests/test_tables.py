"""Tables of scores and results: the columns of the report's files."""

import csv
import pickle
import shutil

import matchbench as mb
import numpy as np
import pytest
from conftest import ESTIMATORS, MATCHERS, command


def same_as_file(table, path):
    """The table has the columns of the file, in that order, and their values."""
    with path.open(newline="") as file:
        head, *rows = csv.reader(file)
    assert list(table) == head and rows
    for name, fields in zip(head, zip(*rows, strict=True), strict=True):
        if isinstance(table[name], list):
            assert table[name] == list(fields), name
        else:
            np.testing.assert_array_equal(table[name], [float(field or "nan") for field in fields], name)


@pytest.fixture(scope="module")
def report(dataset, command_line_run, tmp_path_factory):
    return mb.report(command_line_run, out=tmp_path_factory.mktemp("report"), pictures=0).parent


def test_scores_are_those_of_the_report(command_line_run, report):
    scores = mb.evaluate(command_line_run)
    same_as_file(scores, report / "tables" / "scores.csv")
    for name in ("sp1", "sp15", "rotation_sp15", "translation_sp1", "repetitions", "auc_deviation", "no_support", "search_s"):
        assert isinstance(scores[name], np.ndarray), name
    for name in ("pairs", "failed", "repetitions", "broken"):
        assert scores[name].dtype == np.int64, name
    assert scores["protocol"] == ["matchbench"] * 4 and scores["matcher"] == sorted(2 * MATCHERS, key=MATCHERS.index)
    assert np.isnan(scores["auc_low"]).all() and np.isnan(scores["mma3"]).all()
    assert repr(scores).startswith("Scores(4 rows of dataset, matcher, estimator, pairs, failed, auc, sp1, ")
    again = pickle.loads(pickle.dumps(scores))
    assert str(again) == str(scores) and again.verdicts == scores.verdicts


def test_pairs_are_those_of_the_report(dataset, command_line_run, report, tmp_path):
    pairs = mb.pairs(command_line_run)
    same_as_file(pairs, report / "tables" / "pairs.csv")
    rows = len(MATCHERS) * len(ESTIMATORS) * len(dataset.pairs)
    assert len(pairs["outcome"]) == rows and pairs["a"].dtype == np.int64
    first = [row for row in range(rows) if (pairs["matcher"][row], pairs["estimator"][row]) == ("orb", "best")]
    assert np.array_equal(np.column_stack([pairs["a"], pairs["b"]])[first], dataset.pairs)
    # The scores follow from them.
    scores = mb.evaluate(command_line_run)
    (row,) = (row for row in range(4) if (scores["matcher"][row], scores["estimator"][row]) == ("orb", "best"))
    assert scores["sp10"][row] == np.mean(pairs["pose_error"][first] < 10)
    assert repr(pairs).startswith(f"Pairs({rows} rows of dataset, ")
    # Of homographies, without the dataset, and with a pair that broke.
    wall = mb.rendered_scene("mural", tmp_path / "scenes", frames=3, size=(160, 120))

    def broken(a, b):
        raise RuntimeError("out of luck")

    with pytest.warns(UserWarning, match="out of luck"):
        run = mb.run(wall, ["orb", broken], "best-h", out=tmp_path / "run", progress=False)
    scores = mb.evaluate(run)
    assert run.failed == scores["broken"].sum() == 2 and (scores["failed"] >= scores["broken"]).all()
    shutil.rmtree(wall.path)
    with pytest.warns(UserWarning, match="no baselines of mural"):
        pairs = mb.pairs(run)
    assert np.isnan(pairs["baseline"]).all() and not np.isnan(pairs["corner_error"]).all()
    assert set(np.array(pairs["outcome"])[np.array(pairs["matcher"]) == "broken"]) == {"broken"}
    with pytest.raises(mb.Error, match="nothing"):
        mb.pairs(tmp_path / "nothing")
    with pytest.raises(TypeError, match="run: a value of type int; give a Run or the path of its folder"):
        mb.pairs(7)


def test_scores_by_protocol_are_what_the_command_prints(dataset, command_line_run, tmp_path):
    for protocol in ("superglue", ["imc", "roma"], "all"):
        names = protocol if isinstance(protocol, str) else ",".join(protocol)
        scores = mb.evaluate(command_line_run, protocol=protocol)
        printed = command("eval", command_line_run, "--protocol", names)
        assert printed.stdout.splitlines() == str(scores).splitlines()
        table = tmp_path / f"{names}.csv"
        assert command("eval", command_line_run, "--protocol", names, "--format", "csv", "--out", table).returncode == 0
        same_as_file(scores, table)
    scores = mb.evaluate(command_line_run, protocol="superglue")
    assert scores["protocol"] == ["superglue"] * 4 and "images were as they are" in scores["otherwise"][0]
    assert scores["exact_auc_5"].tolist() == mb.evaluate(command_line_run)["exact_auc_5"].tolist()
    assert "exact_auc_5_low" in scores and "maa_10" not in scores and "<pre>" in scores._repr_html_()
    with pytest.raises(ValueError, match="did you mean `superglue`"):
        mb.evaluate(command_line_run, protocol="superglu")
    with pytest.raises(ValueError, match="protocol: 'imc,roma' is one name; give a list"):
        mb.evaluate(command_line_run, protocol="imc,roma")


def test_names_of_a_table_stay_names():
    text = 'dataset,group,count,known,some\n"06",a,1,1.0,\n"a, ""b""",,12,0.5,2.0\n\'=1+1,ab,0,1e-7,\n'
    table = mb.Scores.of_csv(text)
    assert table["dataset"] == ["06", 'a, "b"', "=1+1"] and table["group"] == ["a", "", "ab"]
    assert table["count"].dtype == np.int64 and table["count"].tolist() == [1, 12, 0]
    assert table["known"].dtype == np.float64 and table["known"].tolist() == [1.0, 0.5, 1e-7]
    np.testing.assert_array_equal(table["some"], [np.nan, 2.0, np.nan])
    assert repr(mb.Scores.of_csv("dataset,auc\na,0.5\n")) == "Scores(1 row of dataset, auc)"
    none = mb.Scores.of_csv("dataset,auc\n")
    assert none["dataset"] == [] and none["auc"].shape == (0,) and repr(none) == "Scores(0 rows of dataset, auc)"
