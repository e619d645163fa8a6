import pytest

from shimmy_ros.gear.parameter_file import load_limits, load_parameters, reference_parameters
from shimmy_ros.gear.parameters import Damper, Limits, ParameterError, changed
from shimmy_ros.resources import resource_directory

REFERENCE = resource_directory("config") / "reference_gear.yaml"
GEAR, DAMPER = reference_parameters()


def write(folder, text):
    path = folder / "parameters.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_reference_gear_has_the_values_it_is_known_by():
    assert (GEAR.strut_inertia, GEAR.wheel_mass, GEAR.trunnion_to_axle) == (60.0, 25.0, 1.10)
    assert (GEAR.trail, GEAR.swivel_inertia, GEAR.wheel_polar_inertia) == (0.08, 1.0, 0.6)
    assert (GEAR.wheel_radius, GEAR.damper_inertia, GEAR.strut_rake) == (0.30, 0.005, 0.10)
    assert (GEAR.strut_tilt_stiffness, GEAR.damper_linkage_stiffness) == (5.0e5, 6.0e4)
    assert (GEAR.tyre_lateral_stiffness, GEAR.tyre_torsional_stiffness) == (2.5e5, 3.0e3)
    assert (GEAR.rolling_alpha, GEAR.rolling_beta, GEAR.rolling_gamma) == (28.0, 10.0, 1.0)
    assert DAMPER.linear_damping == 2.0


@pytest.mark.parametrize(("name", "quadratic", "coulomb"), [
    ("damper_05_05", 5.0, 5.0), ("damper_10_20", 10.0, 20.0),
    ("damper_20_15", 20.0, 15.0), ("damper_50_10", 50.0, 10.0)])
def test_a_damper_file_overrides_the_damper_alone(name, quadratic, coulomb):
    gear, damper = load_parameters(REFERENCE, resource_directory("config") / f"{name}.yaml")
    assert gear == GEAR
    assert damper == Damper(2.0, quadratic, coulomb)


def test_a_later_file_overrides_single_values(tmp_path):
    later = write(tmp_path, "/**: {ros__parameters: {gear: {trail: 0.05}, damper: {}}}")
    assert load_parameters(REFERENCE, later) == (changed(GEAR, trail=0.05), DAMPER)


def test_a_nodes_params_file_is_read_as_it_is(tmp_path):
    nodes = write(tmp_path, """
/shimmy/predictor:
  ros__parameters:
    harmonics: 4
    gear: {trail: 0.05}
/shimmy:
  simulator:
    ros__parameters:
      kick: 3.0
      damper: {coulomb_torque: 7}
""")
    assert load_parameters(REFERENCE, nodes) == (changed(GEAR, trail=0.05),
                                                 changed(DAMPER, coulomb_torque=7.0))


def test_limits_are_read_from_the_same_files(tmp_path):
    first, second = tmp_path / "first", tmp_path / "second"
    for folder in (first, second):
        folder.mkdir()
    files = [REFERENCE,
             write(first, "/**: {ros__parameters: {limits: {swivel: 0.3, strut_tilt: 0.1}}}"),
             write(second, "predictor: {ros__parameters: {limits: {swivel: 1}, harmonics: 4}}")]
    assert load_limits(*files) == Limits(swivel=1.0, strut_tilt=0.1)
    assert load_parameters(*files) == (GEAR, DAMPER)


@pytest.mark.parametrize("files", [[], [REFERENCE]])
def test_limits_that_no_file_names_have_their_defaults(files):
    assert load_limits(*files) == Limits()


@pytest.mark.parametrize(("text", "reason"), [
    ("/**: {ros__parameters: {limits: 3}}", "limits in parameter file .* is 3, but must map"),
    ("/**: {ros__parameters: {limits: {tilt: 0.1}}}", r"limits\.tilt is not a parameter"),
    ("/**: {ros__parameters: {limits: {swivel: 0}}}", r"limits\.swivel is 0, but must be in"),
    ("/**: {ros__parameters: {limits: {tyre_deflection: .inf}}}",
     r"limits\.tyre_deflection is inf"),
])
def test_what_is_wrong_with_limits_is_said_in_one_line(tmp_path, text, reason):
    with pytest.raises(ParameterError, match=reason) as refusal:
        load_limits(REFERENCE, write(tmp_path, text))
    assert "\n" not in str(refusal.value)


def test_the_documented_limits_are_the_defaults():
    text = REFERENCE.read_text(encoding="utf-8")
    for name, value in vars(Limits()).items():
        assert f"    #   {name}: {value:g} " in text


@pytest.mark.parametrize(("text", "reason"), [
    ("a: [1", "cannot be read"),
    ("", "has no ros__parameters with a gear, damper or limits group"),
    ("- 1\n- 2", "has no ros__parameters"),
    ("gear: {trail: 0.1}", "has no ros__parameters"),
    ("/**: {ros__parameters: {harmonics: 4}}", "has no ros__parameters"),
    ("/**: {ros__parameters: {gear: 3}}", "gear in parameter file .* is 3, but must map names"),
    ("/**: {ros__parameters: {damper: [1]}}", r"damper in parameter file .* is \[1\]"),
    ("/**: {ros__parameters: {gear: {mass: 1.0}}}", r"gear\.mass is not a parameter"),
    ("/**: {ros__parameters: {gear: {trail: far}}}", r"gear\.trail is 'far'"),
    ("/**: {ros__parameters: {gear: {trail: .nan}}}", r"gear\.trail is nan"),
    ("/**: {ros__parameters: {gear: {3: 1.0}}}", r"gear\.3 is not a parameter"),
])
def test_what_is_wrong_with_a_file_is_said_in_one_line(tmp_path, text, reason):
    with pytest.raises(ParameterError, match=reason) as refusal:
        load_parameters(REFERENCE, write(tmp_path, text))
    assert "\n" not in str(refusal.value)


def test_a_file_that_is_not_there_or_not_text_is_named(tmp_path):
    with pytest.raises(ParameterError, match=r"nowhere\.yaml cannot be read"):
        load_parameters(tmp_path / "nowhere.yaml")
    binary = tmp_path / "binary.yaml"
    binary.write_bytes(b"\xff\xfe\x00gear")
    with pytest.raises(ParameterError, match=r"binary\.yaml cannot be read"):
        load_parameters(binary)


def test_a_damper_alone_is_not_enough():
    with pytest.raises(ParameterError, match=r"gear\.strut_inertia is missing"):
        load_parameters(resource_directory("config") / "damper_10_20.yaml")
