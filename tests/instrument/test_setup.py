"""Files and settings that a measurement is set up with."""

import json

import pytest
import yaml
from pydantic import ValidationError

from grabberd.archive.measure_setups import (
    location_settings,
    measure_setup,
    nominal_rig,
    settings_of,
    settings_of_capture,
)
from grabberd.config import DeviceConfig, RigConfig, TargetsConfig, shipped_configs
from grabberd.core.measurement import LocationSettings
from grabberd.errors import InputError
from grabberd.files.reading import read_documents, read_yaml

OBJECT = shipped_configs() / "objects" / "liner.yaml"
CALIBRATION = shipped_configs() / "fake.calibration.json"


def config(**targets: float) -> DeviceConfig:
    return DeviceConfig(driver="fake", targets=TargetsConfig(**targets))


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "is empty"),
        ("# nothing but words\n", "is empty"),
        ("- {id: 1}", "has no keys: it is"),
        ("108", "has no keys: it is '108'"),
        ("targets: [", "cannot be read: not valid YAML"),
    ],
)
def test_a_file_that_is_no_mapping_is_refused_by_name(tmp_path, content, said):
    file = tmp_path / "frame.yaml"
    file.write_text(content)
    with pytest.raises(InputError, match=rf"frame\.yaml {said}"):
        read_yaml(file)


def test_limits_of_the_targets_sizes_come_from_object_and_calibration():
    documents = read_documents(CALIBRATION, OBJECT)
    setup = measure_setup(documents, settings_of(config()))
    # 1.5 mm at 1:30 are 5.8 pixels of 8.6 by 8.3 µm.
    assert setup.location == LocationSettings()
    assert setup.sized.limits_px == pytest.approx((0.43 * 5.8, 2.6 * 5.8), rel=0.03)


def test_limits_that_are_configured_in_mm_stand():
    documents = read_documents(CALIBRATION, OBJECT)
    setup = measure_setup(documents, settings_of(config(least_mm=1.0, most_mm=7.5)))
    # A pixel is .26 mm wide on the object.
    assert setup.sized.limits_px == pytest.approx((1.0 / 0.26, 7.5 / 0.26), rel=0.03)
    alone = measure_setup(documents, settings_of(config(least_mm=6.0))).sized.limits_px
    assert alone[0] == pytest.approx(6.0 / 0.26, rel=0.03)
    assert alone[1] > alone[0]


def test_a_capture_keeps_the_limits_it_was_taken_with():
    stored = json.loads(config(most_mm=3.0).model_dump_json())
    assert settings_of_capture(stored)["targets"] == {"least_mm": None, "most_mm": 3.0}
    assert location_settings(settings_of_capture(stored), 4.0).max_diameter_px == 12.0


def test_settings_without_a_scale_have_no_limits_in_pixels():
    assert location_settings(settings_of(config(most_mm=3.0))).max_diameter_px is None


def test_the_least_size_is_below_the_greatest():
    with pytest.raises(ValidationError, match="least_mm 2 is not below most_mm 1"):
        TargetsConfig(least_mm=2, most_mm=1)


def test_a_rig_is_that_of_its_configuration():
    rig = RigConfig.model_validate(yaml.safe_load("{columns: 1920, lines: 1080, focal_length_mm: 16}"))
    assert (nominal_rig(rig).columns, nominal_rig(rig).focal_length_mm) == (1920, 16)
