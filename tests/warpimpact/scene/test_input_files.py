"""Files that people name: tables of any spreadsheet, and what to type where TOML is not valid."""

from pathlib import Path

import pytest

from warpimpact.scene import Hits
from warpimpact.scene.input_files import parsed


@pytest.mark.parametrize(
    "text",
    [
        "hit_y,hit_z\n0.001,-0.25e-3\n",
        "hit_y;hit_z\n0,001;-0,25e-3\n;\n",
        "sep=;\r\nhit_y;hit_z\r\n0,001;-0,25e-3\r\n",
        "sep=|\nhit_y|hit_z\n0.001|-0.25e-3\n",
        "# of a gauge\nhit_y\thit_z\n0,001\t-0,00025\n",
        "\ufeffhit_y [mm];hit_z [mm]\n1;-0,25\n",
    ],
)
def test_tables_of_any_spreadsheet_are_read(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    listed = Hits(sampling="list", file=tmp_path / "a.csv").listed
    assert listed is not None
    assert {name: values.tolist() for name, values in listed.items()} == {"hit_y": [0.001], "hit_z": [-0.00025]}


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("hit_y\thit_z\n1,250\t0\n", 'line 2: got "1,250", whose comma may stand for thousands'),
        ("hit_y;hit_z\n1.250,5;0\n", 'line 2: hit_y: got "1.250,5", but it must be a finite number'),
        ("hit_y,hit_z\n0,001,0,002\n", "but a row has 2 finite numbers; decimal commas need semicolons"),
    ],
)
def test_a_comma_of_two_meanings_is_refused(tmp_path: Path, text: str, sentence: str) -> None:
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=sentence):
        Hits(sampling="list", file=tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("line", "advice"),
    [
        ("thickness = 4 mm", 'thickness = "4 mm"'),
        ("thickness = 4,0 mm", 'thickness = "4,0 mm"'),
        ("rotation = 20°", 'rotation = "20°"'),
        ("title = plates", 'title = "plates"'),
        ('pattern = { shape = "circle", diameter = 5 mm, spacing = 2 }', 'diameter = "5 mm"'),
        ("irreducible = True", "irreducible = true"),
        ("irreducible = no", "irreducible = false"),
        ("pattern = {\n shape = 1 }", "a table { … } in one line"),
    ],
)
def test_what_is_no_toml_is_followed_by_what_to_type(line: str, advice: str) -> None:
    with pytest.raises(ValueError, match=r"a\.toml: is not valid TOML: ") as caught:
        parsed(f"[plate]\n{line}\n", "a.toml")
    assert str(caught.value).endswith(advice)


def test_a_count_may_have_an_exponent() -> None:
    assert Hits(count=1e4).count == 10_000
    with pytest.raises(ValueError, match="valid integer"):
        Hits(count=1.5)
