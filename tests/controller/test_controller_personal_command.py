"""`surefoot personalise` from outside: questions, answers, resuming, refusals, what it writes."""

from __future__ import annotations

import io
import json
import tomllib
from pathlib import Path
from typing import Any

import pytest

from bridge.cli import main
from bridge.config.load import load_config

MINE = """\
# Anna's walker
[admittance]
damping_free_left_ns_m = 55.0 # measured
mass_horizontal_kg = 35.0

[walker]
wheel_mass_kg = 2.5
"""


@pytest.fixture
def config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "my.toml"
    file.write_text(MINE)
    return file


def run(*words: object) -> int:
    return main(["personalise", *map(str, words), "--config", "my.toml", "--out", "anna"])


def state() -> dict[str, Any]:
    content: dict[str, Any] = json.loads(Path("anna/state.json").read_text())
    return content


def answer_all(choices: str) -> None:
    for choice in choices:
        assert run("answer", {"s": "same"}.get(choice, choice)) == 0


class TestAsking:
    def test_next_names_two_files_that_are_the_users_configuration_with_other_values(
        self, config: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert run("next", "--json", "out.json") == 0
        shown = capsys.readouterr().out
        assert "comparison 1 of 12" in shown
        said = json.loads(Path("out.json").read_text())
        for name in "ab":
            assert f"surefoot up --roles controller --config anna/{name}.toml" in shown
            text = Path(f"anna/{name}.toml").read_text()
            assert "# Anna's walker" in text
            assert "# measured" in text
            values = tomllib.loads(text)["admittance"]
            assert said["question"][name]["admittance"].items() <= values.items()
            loaded = load_config(Path(f"anna/{name}.toml"))
            assert loaded.walker.wheel_mass_kg == 2.5
        in_use = {"mass_horizontal_kg": 35.0, "damping_free_forward_ns_m": 30.0}
        assert in_use in [question["admittance"] for question in said["question"].values()]

    @pytest.mark.parametrize(
        "text",
        [
            "",
            "admittance = { mass_horizontal_kg = 35.0 }\n",
            "admittance.mass_horizontal_kg = 35.0\n[walker]\nwheel_mass_kg = 2.5\n",
            "[walker]\nwheel_mass_kg = 2.5",
        ],
    )
    def test_however_the_configuration_is_written(self, config: Path, text: str) -> None:
        config.write_text(text)
        before = load_config(config)
        run("next", "--comparisons", 2, "--force")
        answer_all("ab")
        after = load_config(Path("anna/personal.toml"))
        fragment = {"mass_horizontal_kg", "damping_free_forward_ns_m"}
        assert after.model_copy(update={"admittance": before.admittance}) == before
        for key, value in after.admittance.model_dump().items():
            assert key in fragment or value == getattr(before.admittance, key)

    def test_next_again_is_the_same_question(self, config: Path, capsys: pytest.CaptureFixture[str]) -> None:
        run("next")
        first = capsys.readouterr().out
        run("next")
        assert capsys.readouterr().out == first

    def test_the_end_writes_the_best_with_the_values_before(
        self, config: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        run("next", "--comparisons", 4)
        answer_all("abs")
        capsys.readouterr()
        answer_all("a")
        done = capsys.readouterr()
        fragment = tomllib.loads(done.out)["admittance"]
        assert set(fragment) == {"mass_horizontal_kg", "damping_free_forward_ns_m"}
        assert "# was 35" in done.out
        assert "# was 30" in done.out
        assert "4 comparisons" in done.out
        text = Path("anna/personal.toml").read_text()
        assert fragment.items() <= tomllib.loads(text)["admittance"].items()
        assert "# was 35" in text
        assert "# measured" in text
        assert not Path("anna/a.toml").exists()
        assert config.read_text() == MINE
        # what was found may be used at once
        assert load_config(Path("anna/personal.toml")).admittance.mass_horizontal_kg == fragment["mass_horizontal_kg"]

    def test_answers_from_a_pipe_are_taken_one_by_one(
        self, config: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        monkeypatch.setattr("sys.stdin", io.StringIO("a\nbeta\n\nu\nb\ns\nq\na\n"))
        assert run("--comparisons", 5) == 0
        done = capsys.readouterr()
        assert done.out == ""
        assert "'beta' is no answer" in done.err
        assert "2 of 5 answered" in done.err
        assert [reply["felt"] for reply in state()["replies"]] == ["b", "same"]
        monkeypatch.setattr("sys.stdin", io.StringIO("a\na\nb\n"))
        assert run() == 0
        assert "[admittance]" in capsys.readouterr().out

    def test_undo_opens_the_question_before(self, config: Path) -> None:
        run("next")
        answer_all("ab")
        before = state()
        answer_all("s")
        assert run("undo") == 0
        after = state()
        assert after["replies"] == before["replies"]
        assert after["asked"] == before["asked"]
        assert after["settings"] == before["settings"]

    def test_a_study_that_is_over_can_go_on(self, config: Path) -> None:
        run("next", "--comparisons", 3)
        answer_all("aba")
        assert Path("anna/personal.toml").exists()
        assert run("next", "--comparisons", 5) == 0
        assert not Path("anna/personal.toml").exists()
        answer_all("ab")
        assert len(state()["replies"]) == 5


class TestResuming:
    def test_a_resumed_study_asks_what_an_uninterrupted_one_asks(
        self, config: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("sys.stdin", io.StringIO("a\nb\ns\nb\na\na\n"))
        run("--comparisons", 8)
        whole = state()
        run("next", "--comparisons", 8, "--force")
        answer_all("absbaa")
        assert state() == whole

    def test_another_seed_asks_something_else(self, config: Path) -> None:
        run("next")
        first = state()["settings"]
        run("next", "--force", "--seed", 5)
        assert state()["settings"] != first

    def test_axes_are_remembered(self, config: Path) -> None:
        run("next", "--axes", "yaw")
        answer_all("a")
        assert state()["axes"] == ["yaw"]

    def test_nothing_but_whole_files_is_left(self, config: Path) -> None:
        run("next")
        answer_all("ab")
        assert {path.name for path in Path("anna").iterdir()} == {"state.json", "a.toml", "b.toml"}


class TestRefusals:
    @pytest.mark.parametrize(
        ("words", "said"),
        [
            (["answer"], "expected a, b or same"),
            (["answer", "c"], "answer c: expected a, b or same"),
            (["next", "a"], "only answer takes a choice"),
            (["next", "--axes", "up"], "--axes up: no such axis; known: forward, left, yaw"),
            (["next", "--axes", "left,left"], "at most once"),
            (["next", "--comparisons", "0"], "--comparisons"),
            (["next", "--run"], "--run is for ask"),
            (["answer", "a"], "no study there yet"),
            (["undo"], "no study there yet"),
            (["show"], "no study there yet"),
            (["perhaps"], "perhaps"),
        ],
    )
    def test_bad_words_are_one_line(
        self, config: Path, words: list[str], said: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert run(*words) == 2
        errors = capsys.readouterr().err
        assert said in errors
        assert errors.count("\n") == 1
        assert not Path("anna").exists()

    @pytest.mark.parametrize(
        ("change", "said"),
        [
            ("mass_horizontal_kg = 36.0", "was begun with admittance.mass_horizontal_kg = 35 in 11.7 .. 105"),
            ("mass_horizontal_kg = 35.0\n[personal]\nspan = 2.0", "the configuration says 35 in 17.5 .. 70"),
        ],
    )
    def test_a_study_of_other_bounds(
        self, config: Path, change: str, said: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        run("next")
        before = state()
        config.write_text(MINE.replace("mass_horizontal_kg = 35.0", change))
        assert run("answer", "a") == 2
        assert said in capsys.readouterr().err
        assert state() == before

    def test_a_study_of_other_axes(self, config: Path, capsys: pytest.CaptureFixture[str]) -> None:
        run("next")
        assert run("next", "--axes", "left") == 2
        assert "asks about forward, not left" in capsys.readouterr().err

    @pytest.mark.parametrize(
        ("spoil", "said"),
        [
            (lambda text: text[: len(text) // 2], "cannot be read"),
            (lambda text: text.replace('"format": 1', '"format": 9'), "is of format 9, this version reads 1"),
            (lambda text: "[]", "is of format None"),
            (lambda text: text.replace('"comparisons": 12', '"comparisons": -1'), "comparisons"),
            (lambda text: text.replace('"seed"', '"seeed"'), "see"),
            (lambda text: text.replace("35.0", "9000.0", 3), "9000"),
            (lambda text: text.replace('"asked"', '"felt"'), "asked"),
            (lambda text: text.replace("mass_horizontal_kg", "inertia_yaw_kg_m2"), "asks about inertia_yaw_kg_m2"),
            (lambda text: json.dumps({**json.loads(text), "asked": [0, 0]}), "comparison 1 is between 0 and 0"),
            (lambda text: json.dumps({**json.loads(text), "asked": None}), "settings: there are 2, expected 1"),
            (lambda text: json.dumps({**json.loads(text), "settings": []}), "settings: there are 0, expected 2"),
        ],
    )
    def test_a_damaged_state_is_named_and_left(
        self, config: Path, spoil: Any, said: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        run("next")
        file = Path("anna/state.json")
        file.write_text(spoil(file.read_text()))
        damaged = file.read_text()
        assert run("answer", "a") == 2
        errors = capsys.readouterr().err
        assert "anna/state.json: " in errors
        assert said in errors
        assert file.read_text() == damaged

    def test_an_answer_too_many(self, config: Path, capsys: pytest.CaptureFixture[str]) -> None:
        run("next", "--comparisons", 1)
        answer_all("b")
        assert run("answer", "b") == 2
        assert "all 1 comparisons are answered" in capsys.readouterr().err

    def test_nothing_to_take_back(self, config: Path, capsys: pytest.CaptureFixture[str]) -> None:
        run("next")
        assert run("undo") == 2
        assert "no answer to take back" in capsys.readouterr().err

    def test_a_folder_that_cannot_be(self, config: Path, capsys: pytest.CaptureFixture[str]) -> None:
        Path("anna").write_text("a file")
        assert run("next") == 2
        assert "anna" in capsys.readouterr().err
        assert Path("anna").read_text() == "a file"
