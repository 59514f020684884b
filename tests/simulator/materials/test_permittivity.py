from pathlib import Path

import numpy as np
import pytest
from scipy.constants import epsilon_0

from simulator.materials import permittivity
from simulator.materials.permittivity import (
    ConstantPermittivity,
    MaterialError,
    PowerLawPermittivity,
    TabulatedPermittivity,
)

BAND = np.linspace(220e9, 330e9, 5)


def test_the_rows_are_those_that_sionna_rt_uses() -> None:
    from sionna.rt.radio_materials.itu import ITU_MATERIALS_PROPERTIES

    for name, rows in permittivity.ITU_ROWS.items():
        theirs = ITU_MATERIALS_PROPERTIES[name]
        for lowest, highest, real, factor, exponent in rows:
            assert theirs[(lowest, highest)] == (real, 0.0, factor, exponent)


def test_plasterboard_conducts_as_the_recommendation_says() -> None:
    values = permittivity.itu_permittivity("plasterboard", BAND)(BAND)
    np.testing.assert_array_equal(values.real, 2.56)
    np.testing.assert_allclose(
        permittivity.conductivity(values, BAND), 0.0001 * (BAND / 1e9) ** 1.7799, rtol=1e-12
    )
    assert np.all(values.imag < 0)  # exp(+jwt): loss is a negative imaginary part


@pytest.mark.parametrize(
    ("band", "real"), [((57e9, 64e9), 2.73), ((110e9, 330e9), 2.56), ((300e9, 350e9), 2.65)]
)
def test_the_band_chooses_the_row(band: tuple[float, float], real: float) -> None:
    row = permittivity.itu_permittivity("plasterboard", np.array(band))
    assert isinstance(row, PowerLawPermittivity)
    assert row.real == real


def test_a_band_that_no_row_covers_is_refused() -> None:
    with pytest.raises(MaterialError, match=r"'brick': no row .* covers 57-64 GHz \(rows: 1-40"):
        permittivity.itu_permittivity("brick", np.array([57e9, 64e9]))
    with pytest.raises(MaterialError, match="unknown ITU material 'cheese'"):
        permittivity.itu_permittivity("cheese", BAND)


def test_a_band_across_two_rows_that_meet_has_both() -> None:
    band = np.linspace(75e9, 130e9, 1101)
    joined = permittivity.itu_permittivity("concrete", band)(band)
    ends = [
        permittivity.itu_permittivity("concrete", np.array([f]))(np.array([f]))[0]
        for f in (75e9, 130e9)
    ]
    np.testing.assert_allclose(joined[[0, -1]], ends, rtol=1e-12)
    # No step: of 0.07 in all over a third of the band, a thousandth at a sample.
    assert np.abs(np.diff(joined)).max() < 1e-3
    assert np.all(joined.imag < 0)


def test_a_row_is_not_used_outside_the_band_it_was_fitted_to() -> None:
    plasterboard = permittivity.itu_permittivity("plasterboard", BAND)
    with pytest.raises(MaterialError, match="covers 110-330 GHz, but the radio uses 60-60 GHz"):
        plasterboard(np.array([60e9]))


def test_a_table_passes_through_its_entries_and_is_linear_between(tmp_path: Path) -> None:
    path = tmp_path / "board.csv"
    path.write_text("frequency_ghz, eps_real, eps_imag\n220,2.5,0.1\n330,2.7,0.3\n")
    table = permittivity.read_permittivity(path)
    np.testing.assert_allclose(
        table(np.array([220e9, 275e9, 330e9])), [2.5 - 0.1j, 2.6 - 0.2j, 2.7 - 0.3j], rtol=1e-14
    )
    with pytest.raises(MaterialError, match=r"board\.csv covers 220-330 GHz, but .* 210-"):
        table(np.array([210e9, 300e9]))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("frequency_ghz,eps_real\n220,2.5\n", "the first line lacks eps_imag"),
        ("", "the first line lacks frequency_ghz, eps_real, eps_imag"),
        ("frequency_ghz,eps_real,eps_imag\n220,2.5,x\n", "line 2: not three numbers"),
        ("frequency_ghz,eps_real,eps_imag\n220,2.5\n", "line 2: not three numbers"),
        ("frequency_ghz,eps_real,eps_imag\n220,2.5,0.1\n", "1 frequencies; a table needs at least"),
        ("frequency_ghz,eps_real,eps_imag\n230,2.5,0\n220,2.5,0\n", "positive and increasing"),
        ("frequency_ghz,eps_real,eps_imag\n220,2.5,-0.1\n330,2.5,0\n", r"2\.5 - -0\.1j is no"),
        ("frequency_ghz,eps_real,eps_imag\n220,nan,0.1\n330,2.5,0\n", "nan - 0.1j is no"),
    ],
)
def test_a_table_that_is_none_is_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "board.csv"
    path.write_text(text)
    with pytest.raises(MaterialError, match=message):
        permittivity.read_permittivity(path)


def test_a_table_that_is_missing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MaterialError, match=r"none\.csv: cannot be read"):
        permittivity.read_permittivity(tmp_path / "none.csv")


def test_a_binary_file_is_no_table(tmp_path: Path) -> None:
    path = tmp_path / "board.csv"
    path.write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(MaterialError, match="cannot be read"):
        permittivity.read_permittivity(path)


@pytest.mark.parametrize("value", [0.5 + 0j, 2.0 + 0.1j, complex("nan")])
def test_a_permittivity_with_gain_or_below_vacuum_is_refused(value: complex) -> None:
    with pytest.raises(MaterialError, match="is no permittivity of a passive dielectric"):
        ConstantPermittivity(value=value)


def test_frequencies_of_a_table_have_to_rise() -> None:
    with pytest.raises(MaterialError, match="needs at least two, positive and increasing"):
        TabulatedPermittivity(
            name="t", frequencies=np.array([2e9, 2e9]), values=np.array([2.0 + 0j, 2.0])
        )


def test_a_loss_tangent_of_one_is_the_conductivity_of_the_displacement_current() -> None:
    sigma = permittivity.conductivity(np.array([3.0 - 3.0j]), np.array([1e9]))
    assert sigma[0] == pytest.approx(2 * np.pi * 1e9 * epsilon_0 * 3, rel=1e-15)


def test_a_conductivity_is_the_loss_of_its_displacement_current() -> None:
    frequencies = np.array([1e9, 28e9, 300e9])
    made = PowerLawPermittivity.of_conductivity(2.1, 0.01)(frequencies)
    np.testing.assert_allclose(made.real, 2.1)
    np.testing.assert_allclose(permittivity.conductivity(made, frequencies), 0.01, rtol=1e-12)


@pytest.mark.parametrize(
    ("ghz", "lowest", "highest"),
    [((60.0, 61.0), 3.91, 4.15), ((0.5, 0.6), 3.91, 3.91), ((400.0, 410.0), 4.15, 4.15)],
)
def test_beyond_its_rows_a_material_takes_the_nearest_ones(
    ghz: tuple[float, float], lowest: float, highest: float
) -> None:
    band = 1e9 * np.array(ghz)
    with pytest.raises(MaterialError, match="beyond_itu = true"):
        permittivity.itu_permittivity("brick", band)
    values = permittivity.itu_permittivity("brick", band, beyond=True)(band)
    assert ((values.real >= lowest) & (values.real <= highest)).all()
    assert (values.imag < 0).all()


def test_where_a_row_covers_the_band_nothing_is_taken_from_beyond() -> None:
    band = np.array([20e9, 30e9])
    allowed = permittivity.itu_permittivity("brick", band, beyond=True)(band)
    np.testing.assert_array_equal(allowed, permittivity.itu_permittivity("brick", band)(band))
