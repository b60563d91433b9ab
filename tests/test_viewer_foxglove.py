"""A layout for Foxglove: every path is in the log, every panel is placed, and it opens where the Rerun view does."""

import importlib.util
import json
import re
import sys
from pathlib import Path

import outside
import pytest
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorSet
from mcap.reader import make_reader

from rig.core.frame import SIGNALS, Health, State
from rig.flight.fly import fly
from rig.show.viewer import blueprint, foxglove, opened
from rig.show.viewer.facts import Facts, FaultFact, Shown

SPLIT = "faults=[{kind='offset', signal='angle_of_attack', channels=[3,4], start_s=0.5, offset=0.2}]"
PATH = re.compile(r"(?P<topic>(?:/\w+)+)(?:\.(?P<field>\w+))?(?:\.@(?P<modifier>\w+))?")
KINDS = {"Tab", "Plot", "StateTransitions", "Indicator", "RawMessages", "Markdown", "RosOut", "3D", "map"}
TYPES = {"RosOut": "Log", "map": "Map", "3D": "ThreeDee"}  # where the library names a panel otherwise than a file does


@pytest.fixture(scope="module")
def hardover(tmp_path_factory) -> Path:
    return fly(overrides=["duration_s=2", "faults.0.start_s=0.5"], out=tmp_path_factory.mktemp("logs")).log


@pytest.fixture(scope="module")
def split(tmp_path_factory) -> Path:
    return fly(overrides=["duration_s=2", SPLIT], out=tmp_path_factory.mktemp("logs")).log


def made(log: Path) -> dict:
    read = opened.read([log])
    return foxglove.layout(read.about.layout.shown[-1], read.about.text)


@pytest.fixture(scope="module")
def layout(hardover) -> dict:
    return made(hardover)


def leaves(node) -> list[str]:
    """Ids in a tree of panels; each inner node has the keys of a split, and no other."""
    if isinstance(node, str):
        return [node]
    assert set(node) == {"direction", "first", "second", "splitPercentage"}
    assert node["direction"] in ("row", "column") and 0 < node["splitPercentage"] < 100
    return leaves(node["first"]) + leaves(node["second"])


def tabs(layout: dict) -> dict[str, list[str]]:
    return {tab["title"]: leaves(tab["layout"]) for tab in layout["configById"][layout["layout"]]["tabs"]}


def panels(layout: dict, tab: str, kind: str) -> list[dict]:
    return [layout["configById"][name] for name in tabs(layout)[tab] if name.startswith(f"{kind}!")]


def paths(layout: dict) -> list[tuple[str, str]]:
    """Every message path, with the kind of its panel."""
    found = []
    for name, config in layout["configById"].items():
        kind = name.split("!")[0]
        found += [(kind, series["value"]) for series in config.get("paths", ())]
        keys = ("path", "topicPath", "topicToRender", "followTopic")
        found += [(kind, config[key]) for key in keys if key in config]
        found += [(kind, topic) for topic in config.get("topics", ())]
    return found


def schemas(log: Path) -> dict[str, dict[str, FieldDescriptorProto]]:
    """Fields by name of each topic, from the descriptors that are in the file."""
    with log.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    found = {}
    for channel in summary.channels.values():
        schema = summary.schemas[channel.schema_id]
        package, short = schema.name.rsplit(".", 1)
        files = FileDescriptorSet.FromString(schema.data).file
        (message,) = (m for f in files if f.package == package for m in f.message_type if m.name == short)
        found[channel.topic] = {field.name: field for field in message.field}
    return found


def test_every_panel_stands_in_one_place_and_every_place_has_a_panel(layout):
    configs, root = layout["configById"], layout["layout"]
    placed = [root, *(name for names in tabs(layout).values() for name in names)]
    assert sorted(placed) == sorted(configs) and len(set(placed)) == len(placed)
    assert {name.split("!")[0] for name in configs} == KINDS
    assert {"globalVariables", "userNodes", "playbackConfig"} <= set(layout)
    some = (blueprint.SERVOS, blueprint.COMPUTERS, blueprint.UNIT)  # of flights that have them
    assert list(tabs(layout)) == [tab for tab in blueprint.TABS if tab not in some]
    json.dumps(layout, allow_nan=False)


@pytest.fixture(scope="module")
def beside(tmp_path_factory) -> Path:
    """A flight with servo actuators and four computers."""
    sets = ["duration_s=0.5", "faults=[]", "computers.count=4", 'actuators.model="servo"']
    return fly(overrides=sets, out=tmp_path_factory.mktemp("logs")).log


def test_flights_with_servos_and_several_computers_have_their_tabs(beside):
    layout = made(beside)
    assert list(tabs(layout)) == [tab for tab in blueprint.TABS if tab != blueprint.UNIT]
    states = [row["value"] for each in panels(layout, "computers", "StateTransitions") for row in each["paths"]]
    assert "/computer/D.health" in states and "/ccdl.state_C_B" in states
    (of_computers, _) = panels(layout, "computers", "StateTransitions")
    (row,) = (row for row in of_computers["paths"] if row["label"] == "lane B")
    looks = {state["value"]: state["label"] for state in row["customStates"]["states"]}
    assert (looks[Health.ENGAGED], looks[Health.FAILED]) == ("engaged", "failed")
    shut_off = [row["value"] for each in panels(layout, "actuators", "StateTransitions") for row in each["paths"]]
    assert len(shut_off) == 12 and "/actuator/rudder.failed_by_4" in shut_off
    angles = [path for kind, path in paths(layout) if kind == "Plot" and path.startswith("/actuator/elevator.lvdt")]
    assert len(angles) == 4 and all(path.endswith(".@rad2deg") for path in angles)
    refuse_other_paths(beside, layout)


def test_every_path_is_a_field_of_a_topic_of_the_log(hardover, layout):
    refuse_other_paths(hardover, layout)


def refuse_other_paths(log: Path, layout: dict) -> None:
    fields = schemas(log)
    for kind, path in paths(layout):
        parsed = PATH.fullmatch(path)
        assert parsed is not None, path
        topic, field, modifier = parsed.group("topic", "field", "modifier")
        assert topic in fields, path
        assert (field is None) == (kind in ("RawMessages", "RosOut", "map", "3D")), path
        assert field is None or field in fields[topic], path
        assert modifier is None or (kind == "Plot" and modifier == "rad2deg"), path


def test_plots_are_in_degrees_where_the_log_is_in_radians_and_nowhere_else(layout):
    units = {signal.topic: signal.unit for signal in SIGNALS}
    turned = set()
    for name, config in layout["configById"].items():
        if not name.startswith("Plot!"):
            continue
        for value in (series["value"] for series in config["paths"]):
            parsed = PATH.fullmatch(value)
            assert parsed is not None
            topic, field = parsed.group("topic", "field")
            angle = units[topic].startswith("rad") if topic in units else re.search("_rad(_s)?$", field) is not None
            assert value.endswith(".@rad2deg") == angle, value
            assert config.get("yAxisLabel", "").startswith("deg") == angle, value
            turned.add(angle)
    assert turned == {True, False}


def test_the_overview_shows_channels_vote_reference_and_truth_of_the_decisive_signal_at_its_time(hardover, layout):
    seen = opened.read([hardover]).about.layout.shown[-1].facts.seen
    assert seen is not None and seen.zoom_s is not None
    whole, zoom = panels(layout, "overview", "Plot")
    names = {"truth", "voted", "reference", "ch_1", "ch_2", "ch_3", "ch_4"}
    for plot in (whole, zoom):
        assert {series["value"] for series in plot["paths"]} == {f"/signal/pitch_rate.{n}.@rad2deg" for n in names}
    assert (zoom["minXValue"], zoom["maxXValue"]) == seen.zoom_s == pytest.approx((0.0, 1.57))
    assert (whole["isSynced"], zoom["isSynced"], "minXValue" in whole) == (True, False, False)
    assert (zoom["minYValue"], zoom["maxYValue"]) == seen.ranges["zoom"]
    _, states = panels(layout, "overview", "StateTransitions")
    shown = [series["value"].rsplit(".", 1)[1] for series in states["paths"]]
    assert shown == ["acting_1", "st_1", "st_2", "st_3", "st_4", "pattern", "decided_by", "source", "level"]
    assert [bulb["path"][-4:] for bulb in panels(layout, "overview", "Indicator")] == ["st_1", "st_2", "st_3", "st_4"]


def test_another_flight_opens_at_its_own_signal(hardover, split, layout):
    other = made(split)
    (raw,), (mine,) = panels(other, "overview", "RawMessages"), panels(layout, "overview", "RawMessages")
    assert (raw["topicPath"], mine["topicPath"]) == ("/signal/angle_of_attack", "/signal/pitch_rate")
    (text,) = panels(other, "overview", "Markdown")
    assert "angle of attack" in text["markdown"]


def test_states_have_the_numbers_of_the_embedded_enums_and_failed_is_red(hardover, layout):
    _, states = panels(layout, "overview", "StateTransitions")
    row = next(series for series in states["paths"] if series["value"].endswith("st_3"))
    named = {state["value"]: (state["label"], state["color"]) for state in row["customStates"]["states"]}
    assert named[State.FAILED] == ("failed", "#d63232") and set(named) == {State.OK, State.SUSPECT, State.FAILED}
    assert schemas(hardover)["/signal/pitch_rate"]["st_3"].type == FieldDescriptorProto.TYPE_ENUM
    bulb = panels(layout, "overview", "Indicator")[2]
    assert {rule["rawValue"]: rule["label"] for rule in bulb["rules"]}[str(int(State.FAILED))] == "failed"


def test_faults_are_named_by_their_bits_eight_in_a_row():
    faults = tuple(FaultFact(f"fault {i}", "heading", start_s=2.0) for i in range(9))
    layout = foxglove.layout(Shown(facts=Facts(faults=faults)), "")
    first, second = panels(layout, "control", "StateTransitions")[0]["paths"][:2]
    assert (first["value"], second["value"]) == ("/flight.acting_1", "/flight.acting_2")
    labels = {state["value"]: state["label"] for state in first["customStates"]["states"]}
    assert labels == {0: "none"} | {2**i: f"fault {i}" for i in range(8)}
    assert [s["label"] for s in second["customStates"]["states"]] == ["none", "fault 8"]


def test_a_flight_without_a_fault_shows_the_surfaces_and_one_of_a_unit_its_times():
    layout = foxglove.layout(Shown(facts=Facts(unit="box", paced=True)), "")
    assert len(panels(layout, "overview", "Plot")) == 2 + len(blueprint.charts.SURFACE)
    assert not any("minXValue" in plot for plot in panels(layout, "overview", "Plot"))
    values = [series["value"] for plot in panels(layout, "unit", "Plot") for series in plot["paths"]]
    assert values == ["/timing.reply_us", "/timing.late_us", "/control.unit_age"]


def test_the_command_writes_it_beside_the_log_or_where_it_is_told(hardover, layout, tmp_path, rig_command):
    log = Path("flight.mcap")
    log.write_bytes(hardover.read_bytes())
    code, text, _ = rig_command("export", log, "--layout", "foxglove")
    assert (code, text) == (
        0,
        f"flight.foxglove.json: {len(layout['configById'])} panels, pitch rate, zoom 0.0 to 1.6 s\n",
    )
    written = json.loads(Path("flight.foxglove.json").read_text())
    assert tabs(written) == tabs(layout) and written["configById"].keys() == layout["configById"].keys()
    code, text, _ = rig_command("export", log, "--layout", "foxglove", "--out", "a.json", "--json")
    about = json.loads(text)
    assert (code, about["out"], about["signal"]) == (0, "a.json", "pitch_rate")
    assert Path("a.json").read_bytes() == Path("flight.foxglove.json").read_bytes()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ([], "--to csv|parquet|npz, or --out FILE"),
        (["--to", "csv", "--layout", "foxglove"], "--to, --layout: only one of them at a time"),
        (["--layout", "plotjuggler"], "--layout plotjuggler: must be foxglove"),
        (["--layout", "foxglove", "--signals", "heading"], "--signals, --for-vote: not with --layout"),
        (["--layout", "foxglove", "--out", "flight.mcap"], "--out flight.mcap: is the input"),
        (["--to", "csv", "--out", "flight.mcap"], "--out flight.mcap: is the input"),
        (["--layout", "foxglove", "--out", "nowhere/a.json"], "no such folder"),
    ],
)
def test_a_wrong_request_is_one_line_exit_code_2_and_nothing_written(hardover, tmp_path, arguments, says, rig_command):
    log = Path("flight.mcap")
    log.write_bytes(hardover.read_bytes())
    code, out, err = rig_command("export", log, *arguments)
    assert (code, out, err.count("\n")) == (2, "", 1) and says in err
    assert list(tmp_path.iterdir()) == [tmp_path / "flight.mcap"] and log.read_bytes() == hardover.read_bytes()


@outside.needs("foxglove layouts")
def test_every_setting_is_one_that_foxgloves_own_library_has(layout):
    spec = importlib.util.spec_from_file_location("foxglove_layouts", outside.layouts_module())
    assert spec is not None and spec.loader is not None
    library = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(library)
    series = {"Plot": library.PlotSeries, "StateTransitions": library.StateTransitionsSeries}
    for name, config in layout["configById"].items():
        kind = name.split("!")[0]
        if kind == "Tab":
            continue
        model = getattr(library, f"{TYPES.get(kind, kind)}Panel")().config
        assert set(config) - {"foxglovePanelTitle"} <= set(model._to_dict()), name
        for each in config.get("paths", ()):
            assert set(each) <= set(series[kind]()._to_dict()), name
            for state in each.get("customStates", {}).get("states", ()):
                assert set(state) == set(library.StateTransitionsRangeCustomState()._to_dict())
        for rule in config.get("rules", ()):
            assert set(rule) == set(library.IndicatorRule()._to_dict())
    (space,) = panels(layout, "flight", "3D")
    assert set(space["cameraState"]) <= set(library.ThreeDeeCameraState()._to_dict())
    assert set(space["scene"]["transforms"]) <= set(library.BaseRendererTransforms()._to_dict())
    assert set(space["layers"]["sea"]) <= set(library.BaseRendererGridLayerSettings()._to_dict())
