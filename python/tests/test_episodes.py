"""The same episodes as on the command line, and what happens to bad input."""

import hashlib
import multiprocessing
import shutil
import signal
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import tomllib

import lotpilot
from lotpilot import _native
from lotpilot.core import Core, EnvOptions, settings_from
from lotpilot.tables import Request, _read

ROOT = Path(__file__).resolve().parents[2]
SHORT = ("episode.metrics.timeout_s=4.0",)


def digest_in_rust(driver, lot, direction="forward", noise="paper", seed=1, trial=0, overrides=()):
    where = settings_from(None, None, overrides)
    return _native.drive_digest(driver, [lot], direction, noise, where, seed, trial)


@pytest.mark.parametrize(
    ("lot", "direction", "noise", "seed", "trial"),
    [
        ("lot-b", "forward", "paper", 1, 0),
        ("lot-a", "reverse", "hard", 7, 3),
        ("test-hard-7", "forward", "clean", 1, 1),
    ],
)
def test_the_expert_driven_from_python_is_the_same_bytes_as_in_rust(lot, direction, noise, seed, trial):
    overrides = ("episode.metrics.timeout_s=15.0",)
    place = {"direction": direction, "noise": noise, "seed": seed, "trial": trial}
    episode = lotpilot.Episode(lot, overrides=overrides, **place)
    while not episode.is_over:
        episode.step(episode.expert_action())
    assert episode.digest() == digest_in_rust("expert", lot, overrides=overrides, **place)
    assert episode.report()["metrics"]["ticks"] == 300


def test_an_episode_steered_otherwise_has_another_digest():
    episode = lotpilot.Episode("lot-b", overrides=SHORT)
    while not episode.is_over:
        episode.step([8.0, 0.0])
    assert episode.digest() != digest_in_rust("expert", "lot-b", overrides=SHORT)


def test_a_function_in_python_has_the_runs_of_the_same_driver_in_rust():
    """A car that always heads straight on, as a function and as steps of episodes: the same metrics, run by run."""
    asked = []

    def straight(grids):
        asked.append(len(grids))
        return np.tile(np.array([8.0, 0.0]), (len(grids), 1))

    where = {"noise": "paper", "overrides": SHORT}
    tables = lotpilot.evaluate({"straight": straight, "scripted": "expert"}, ["lot-b", "lot-c"], trials=2, **where)
    runs = tables.runs
    assert runs["driver"].count("straight") == runs["driver"].count("scripted") == 8
    assert max(asked) == 8, "all cars in one call"
    for index in [0, 5]:
        place = {"direction": runs["direction"][index], "trial": runs["trial"][index]}
        episode = lotpilot.Episode(runs["lot"][index], **place, **where)
        while not episode.is_over:
            episode.step([8.0, 0.0])
        metrics = episode.report()["metrics"]
        assert metrics == {name: runs[name][index] for name in metrics}
    assert tables.summary["driver"][0] == "straight"
    assert runs["replay"][0].startswith("python:straight@")


def test_a_driver_that_remembers_is_told_which_car_it_drives():
    class Remembers:
        def __init__(self):
            self.cars, self.resets = set(), 0

        def drive(self, grids, cars, was_reset):
            self.cars.update(cars.tolist())
            self.resets += int(was_reset.sum())
            return np.full((len(grids), 2), [8.0, 0.0])

    driver = Remembers()
    lotpilot.evaluate({"remembers": driver}, "lot-b", trials=1, overrides=SHORT)
    assert driver.cars == {0, 1} and driver.resets >= 2


def test_functions_are_smoothed_like_every_driver():
    """``smoothing=`` had no effect on them, and they were compared with drivers that it smoothed."""

    def aside(grids):
        return np.stack([np.full(len(grids), 8.0), grids.sum((1, 2)) % 3 - 1.0], 1)

    def digests(smoothing):
        tables = lotpilot.evaluate({"aside": aside}, "lot-b", trials=1, smoothing=smoothing, overrides=SHORT)
        return tables.runs["sha256"]

    assert digests(8.0) != digests(0.0) == digests(None)


def test_a_function_that_raises_while_causes_are_explained_leaves_no_finished_evaluation(tmp_path):
    calls = {"all": 0, "allowed": 10**9}

    def straight(grids):
        calls["all"] += 1
        if calls["all"] > calls["allowed"]:
            raise RuntimeError("out of luck")
        return np.tile([8.0, 0.0], (len(grids), 1))

    where = {"trials": 1, "directions": "forward", "overrides": ("episode.metrics.timeout_s=40.0",)}
    runs = lotpilot.evaluate({"straight": straight}, "lot-b", out=tmp_path / "whole", **where).runs
    assert runs["near_collisions"][0] > 0
    # The drive alone takes a call per tick; what follows explains its near-collisions.
    assert calls["all"] > runs["ticks"][0] + 1
    calls["all"], calls["allowed"] = 0, runs["ticks"][0] + 1
    with pytest.raises(RuntimeError, match="out of luck"):
        lotpilot.evaluate({"straight": straight}, "lot-b", out=tmp_path / "cut", **where)
    assert (tmp_path / "whole" / "finished.toml").exists() and not (tmp_path / "cut" / "finished.toml").exists()


def test_a_lot_is_never_drawn_over_the_file_that_it_is_made_of(tmp_path):
    (path,) = lotpilot.generate("lot-b", out=tmp_path)["path"]
    mine = Path(path)
    text = mine.read_text()
    for overwrite in (False, True):
        with pytest.raises(ValueError, match="what the lot is made of|exists already"):
            lotpilot.generate(str(mine), out=tmp_path, overwrite=overwrite)
    assert mine.read_text() == text


def test_an_evaluation_never_takes_the_place_of_what_it_reads(tmp_path):
    (path,) = lotpilot.generate("lot-b", out=tmp_path)["path"]
    mine = tmp_path / "mine"
    lotpilot.evaluate("expert", "lot-b", trials=1, directions="forward", out=mine)
    lot = mine / "lot.toml"
    lot.write_text(Path(path).read_text())
    with pytest.raises(ValueError, match="what is read lies there"):
        lotpilot.evaluate("expert", str(lot), trials=1, directions="forward", out=mine, overwrite=True)
    assert lot.exists() and (mine / "finished.toml").exists()


def test_the_network_that_ships_needs_no_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    runs = lotpilot.evaluate("trained:default", "lot-b", trials=1).runs
    assert runs["driver"] == ["trained:default"] * 2
    assert sum(runs["near_collisions"]) < 4 and sum(runs["driven_m"]) > 200


def test_noise_may_be_a_number_of_numpy():
    for noise in (np.float32(0.5), np.int64(2)):
        runs = lotpilot.evaluate("expert", "lot-b", trials=1, directions="forward", noise=noise, overrides=SHORT).runs
        assert runs["noise"] == [noise]


def test_functions_are_judged_together_as_trainings_of_one_method():
    def towards(left):
        return lambda grids: np.tile([8.0, left], (len(grids), 1))

    mine = {f"mine-{left}": towards(left) for left in (-1.0, 0.0, 1.0)}
    tables = lotpilot.evaluate(mine, "test:8", trials=1, overrides=SHORT, methods={"mine": list(mine)})
    assert set(tables.trainings["driver"]) == {"mine"} and set(tables.trainings["trainings"]) == {3}


def test_an_evaluation_leaves_the_files_of_the_command_line(tmp_path):
    folder = tmp_path / "straight"
    tables = lotpilot.evaluate("expert", "lot-b", trials=1, directions="forward", overrides=SHORT, out=folder)
    assert {"manifest.toml", "settings.toml", "runs.jsonl", "summary.json", "sha256sums"} <= {
        path.name for path in folder.iterdir()
    }
    assert tables.runs["reference_m"][0] == pytest.approx(139, abs=1)
    with pytest.raises(ValueError, match="straight"):
        lotpilot.evaluate("expert", "lot-b", overrides=SHORT, out=folder)


def test_shards_merge_to_the_bytes_of_one_process(tmp_path):
    """What lotpilot.ray does, without Ray."""

    def straight(grids):
        return np.tile([8.0, 0.0], (len(grids), 1))

    request = Request.of({"straight": straight, "cvm": "cvm"}, ["lot-b", "test:2:easy"], trials=2, overrides=SHORT)
    request.drive(tmp_path / "one")
    # Shards of machines that round otherwise were merged: none said how its machine does.
    features = tomllib.loads((tmp_path / "one" / "manifest.toml").read_text()).get("processor_features", [])
    assert ("avx2" in features) == ("avx2" in Path("/proc/cpuinfo").read_text().split())
    shards = [tmp_path / str(number) for number in (1, 2, 3)]
    for shard in shards:
        request.drive(shard, shard=f"{shard.name}/3")
        assert not (shard / "summary.json").exists(), "no table of a part"
    tables = request.merge(shards[::-1], tmp_path / "merged")
    assert len(tables.runs["driver"]) == 2 * 3 * 2 * 2
    for name in ("runs.jsonl", "failures.jsonl", "summary.json", "settings.toml"):
        assert (tmp_path / "merged" / name).read_bytes() == (tmp_path / "one" / name).read_bytes(), name
    with pytest.raises(ValueError, match="missing: shard 2/3"):
        request.merge([shards[0], shards[2]], tmp_path / "part")
    other = Request.of({"straight": straight}, ["lot-b", "test:2:easy"], trials=2, overrides=SHORT)
    with pytest.raises(ValueError, match="other drivers or settings"):
        other.merge(shards, tmp_path / "other")
    with pytest.raises(ValueError, match="no shard"):
        request.drive(tmp_path / "none", shard="4/3")
    assert not (tmp_path / "part").exists() and not (tmp_path / "other").exists()


def test_an_expert_asked_now_and_then_forgets_what_it_planned_before_it_was_put_back():
    short = ("episode.metrics.timeout_s=40.0",)
    asked, anew = (lotpilot.Episode("lot-b", overrides=short) for _ in range(2))
    asked.expert_action()
    ticks_since = None
    while not asked.is_over and ticks_since != 5:
        resets = asked.report()["metrics"]["near_collisions"]
        asked.step([8.0, 0.0]), anew.step([8.0, 0.0])
        if asked.report()["metrics"]["near_collisions"] > resets:
            ticks_since = 0
        elif ticks_since is not None:
            ticks_since += 1
    assert ticks_since == 5, "it was put back"
    np.testing.assert_array_equal(asked.expert_action(), anew.expert_action())


def test_a_lot_is_checked_for_the_car_that_is_to_drive_there(tmp_path):
    """Where only a smaller car fits, an episode was refused that evaluations and environments drive."""
    lane = tmp_path / "lane.toml"
    lane.write_text(
        'name = "lane"\nboundary = [[-8.0, -0.9], [34.0, -0.9], [34.0, 0.9], [-8.0, 0.9]]\n'
        "reference_path.points = [[0.0, 0.0], [12.0, 0.0]]\n"
    )
    car = {"width_m": 0.8, "length_m": 2.0, "wheelbase_m": 1.2, "rear_overhang_m": 0.4}
    small = [f"episode.vehicle.{name}={value}" for name, value in car.items()] + ["episode.metrics.near_collision_m=0.2"]
    assert lotpilot.Episode(str(lane), overrides=small).place["lot"] == str(lane)
    with pytest.raises(ValueError, match="does not fit"):
        lotpilot.Episode(str(lane))


def test_what_an_import_found_is_said(tmp_path):
    for part in ("car-park.pgm", "car-park.lot.toml"):
        shutil.copy(ROOT / "scenarios/examples" / part, tmp_path)
    text = (ROOT / "scenarios/examples/car-park.yaml").read_text()
    (tmp_path / "car-park.yaml").write_text(text + "colour: green\n")
    lot = str(tmp_path / "car-park.yaml")
    assert any('"colour"' in note for note in lotpilot.Lot(lot).notes)
    assert lotpilot.Lot("lot-b").notes == []
    with pytest.warns(UserWarning, match='"colour"'):
        Core(1, EnvOptions(lots=[lot]), "next_step")
    with pytest.warns(UserWarning, match='"colour"'):
        lotpilot.evaluate("expert", lot, trials=1, directions="forward", overrides=("episode.metrics.timeout_s=1.0",))


def test_the_expert_asked_twice_in_a_tick_answers_once():
    once, twice = (lotpilot.Episode("lot-b", overrides=SHORT) for _ in range(2))
    while not once.is_over:
        once.step(once.expert_action())
        assert np.array_equal(twice.expert_action(), twice.expert_action())
        twice.step(twice.expert_action())
    assert once.digest() == twice.digest()
    assert np.isnan(once.expert_action()).all()


def test_steering_as_the_controller_does_drives_the_same_way():
    points, commands = (lotpilot.Episode("lot-b", action=kind, overrides=SHORT) for kind in ("look_ahead", "steering"))
    while not points.is_over:
        points.step(points.expert_action())
        commands.step(commands.expert_action())
    ours, theirs = points.table(), commands.table()
    for column in ("x_m", "y_m", "heading_rad", "speed_mps", "progress_m"):
        np.testing.assert_array_equal(ours[column], theirs[column])


def test_environments_that_share_a_seed_never_drive_a_trial_twice():
    core = Core(4, EnvOptions(lots=["lot-a", "test:2"], overrides=("episode.metrics.timeout_s=0.1",)), "same_step")
    driven = set()
    core.reset()
    for _ in range(6):
        driven.update(core.cars.places())
        for _ in range(2):
            core.step(np.full((4, 2), [8.0, 0.0]))
    assert len(driven) == 24
    assert {place[0] for place in driven} == {"lot-a", "test-medium-0", "test-medium-1"}
    assert {place[2] for place in driven} == {0, 1, 2, 3}


def test_the_reward_is_the_sum_of_its_terms():
    def total(**weights):
        zero = dict.fromkeys(("progress", "near_collision", "stuck", "contact", "clearance", "smoothness"), 0.0)
        core = Core(1, EnvOptions(lots=["lot-b"], directions="forward", reward={**zero, **weights}), "disabled")
        core.reset()
        rewards, infos = 0.0, []
        for tick in range(300):
            seen, reward, *_ = core.step([[8.0, 1.0 + tick % 2]])
            rewards += reward[0]
            infos.append(core.info(seen, 0))
        return rewards, infos

    rewards, infos = total(near_collision=1.0)
    assert rewards == -infos[-1]["near_collisions"] < 0
    rewards, infos = total(progress=1.0)
    jumps = [b["progress_m"] - a["progress_m"] for a, b in pairwise(infos) if b["event"] in (1, 2)]
    assert rewards == pytest.approx(infos[-1]["progress_m"] - sum(jumps), abs=1e-4)
    steered, _ = total(smoothness=1.0)
    near, infos = total(clearance=1.0)
    assert steered < 0
    assert near == pytest.approx(-sum(max(0.0, 0.5 - info["clearance_m"]) for info in infos), rel=1e-5)
    touched, infos = total(contact=1.0)
    assert touched == -infos[-1]["contacts"]
    weights = EnvOptions().weights()
    terms = {term: total(**{term: 1.0})[0] for term in weights}
    whole, _ = total(**weights)
    assert whole == pytest.approx(sum(weight * terms[term] for term, weight in weights.items()), abs=1e-6)


def test_a_step_is_rewarded_for_what_its_own_action_did():
    """Clearance and turned wheels were those before the action: each action was charged for the one before it."""

    def driven(term):
        reward = {**dict.fromkeys(EnvOptions().weights(), 0.0), term: 1.0}
        core = Core(1, EnvOptions(lots=["lot-b"], directions="forward", reward=reward), "disabled")
        infos, rewards = [core.info(core.reset(), 0)], []
        while infos[-1]["event"] == 0:
            seen, reward, *_ = core.step([[8.0, 1.0 + len(infos) % 2]])
            rewards.append(reward[0])
            infos.append(core.info(seen, 0))
        return rewards, infos

    rewards, infos = driven("smoothness")
    turned = [abs(after["steering_rad"] - before["steering_rad"]) for before, after in pairwise(infos)]
    # In the last tick the car was put back with straight wheels, which nobody steered.
    assert rewards == pytest.approx([-angle for angle in turned[:-1]] + [0.0], abs=1e-6) and max(turned[:-1]) > 0.001
    rewards, infos = driven("clearance")
    assert rewards == pytest.approx([-max(0.0, 0.5 - info["clearance_m"]) for info in infos[1:]], abs=1e-6)
    # The metric is measured before each action: at its n-th tick it is the least of what n steps before had left.
    clearances = [info["clearance_m"] for info in infos]
    least = [min(clearances[:tick]) for tick in range(1, len(infos) - 1)]
    assert [info["clearance_min_m"] for info in infos[1:-1]] == pytest.approx(least, abs=1e-6)
    assert any(now < before for now, before in zip(clearances[1:-1], least, strict=True)), "it comes nearer"
    assert clearances[-1] == infos[-1]["clearance_min_m"], "where it had stopped, not where it was put back"


class Rang(Exception):
    """An alarm clock."""


def interrupted_after(seconds, work):
    """Lets an alarm end some work."""

    def ring(*_):
        raise Rang

    before = signal.signal(signal.SIGALRM, ring)
    try:
        signal.setitimer(signal.ITIMER_REAL, seconds)
        with pytest.raises(Rang):
            work()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize("threads", [1, 2, None])
def test_a_reset_of_many_cars_heeds_signals(threads):
    """Ctrl-C while thousands of lots were drawn had no effect before the last of them."""
    core = Core(4000, EnvOptions(lots=["train:4000:all"], threads=threads), "next_step")
    interrupted_after(0.2, core.reset)
    # Not all of them were reset before the alarm was heard; cars are taken in halves, so it may be any.
    with pytest.raises(lotpilot.EpisodeEnded, match="never reset"):
        core.step(np.full((4000, 2), [8.0, 0.0]))


def test_a_car_that_an_interrupted_reset_did_not_reach_drives_the_episode_that_it_names():
    """It named one of the new seed, and its expert drew from that, while it drove on in one of the old seed."""
    options = EnvOptions(lots=["lot-b"], threads=1, overrides=["expert.label_jitter=0.01"])
    core, twin = (Core(500, options, "next_step") for _ in range(2))
    last = np.arange(500) == 499
    core.reset(last), twin.reset(last)
    interrupted_after(0.05, lambda: core.reset(seeds=[7] * 500))
    assert core.place(0)["seed"] == 7 and core.place(499) == twin.place(499)
    np.testing.assert_array_equal(core.expert_actions()[499], twin.expert_actions()[499])


def test_tables_are_read_from_files_that_are_whole(tmp_path):
    folder = tmp_path / "run"
    where = {"trials": 1, "directions": "forward", "overrides": SHORT}
    whole = lotpilot.evaluate({"the éxpert": "expert"}, "lot-b", out=folder, **where)
    assert whole.runs["driver"] == ["the éxpert"] and _read(folder) == whole
    for name in ("runs.jsonl", "failures.jsonl", "summary.json", "sha256sums"):
        content = (folder / name).read_bytes()
        (folder / name).write_bytes(content + b"\n")
        with pytest.raises(ValueError, match=name):
            _read(folder)
        (folder / name).write_bytes(content)


def test_letters_that_nobody_sees_are_refused_in_names():
    # The first parts lines, the second turns the direction of writing.
    for letter in ("\u2028", "\u202e"):
        with pytest.raises(ValueError, match=r"tables hold its name") as error:
            lotpilot.evaluate({f"the{letter}expert": "expert"}, "lot-b", trials=1, overrides=SHORT)
        assert letter not in str(error.value)


def test_lots_are_drawn_as_on_the_command_line(tmp_path):
    assert lotpilot.lots(["lot-b", "test:2:aisles"]) == ["lot-b", "test-aisles-0", "test-aisles-1"]
    drawn = lotpilot.generate("lot-b", seed=3, out=tmp_path)
    assert Path(drawn["path"][0]).read_text() == drawn["toml"][0]
    lot = lotpilot.Lot(drawn["path"][0])
    assert lot.length_m == drawn["route_m"][0] and len(lot.obstacles) == drawn["obstacles"][0]
    assert lot.route.shape[1] == 3 and lot.boundary.shape[1] == 2
    assert (lot.distances_m(lot.route[:, :2].copy()) > 0).all(), "the route is free"
    assert lot.picture(4.0).shape[2] == 3
    with pytest.raises(ValueError, match="exists already"):
        lotpilot.generate("lot-b", seed=3, out=tmp_path)


def test_settings_are_those_of_the_command_line():
    text = lotpilot.settings("smoke", overrides=["dagger.eta=0.8"])
    assert tomllib.loads(text)["dagger"]["eta"] == 0.8
    with pytest.raises(ValueError, match="did you mean"):
        lotpilot.settings(overrides=["dagger.etta=0.8"])


def rust_loop(threads):
    return _native.RustLoop(1, ["lot-b"], 1, "paper", settings_from(None, None, ()), 6.0, threads, True)


@pytest.mark.parametrize(
    ("make", "error", "part"),
    [
        (lambda: lotpilot.Episode("lot-d"), ValueError, "there are lot-a, lot-b"),
        (lambda: lotpilot.Episode("test:3"), ValueError, "several lots"),
        (lambda: lotpilot.Episode(direction="sideways"), ValueError, "forward and reverse"),
        (lambda: lotpilot.Episode(noise="papr"), ValueError, "clean, paper, hard"),
        (lambda: lotpilot.Episode(action="gas"), ValueError, "look_ahead and steering"),
        (lambda: lotpilot.Episode(overrides=["episode.nothing=1"]), ValueError, "no key"),
        (lambda: lotpilot.Lot("no/such.toml"), ValueError, "no/such.toml"),
        (lambda: lotpilot.Lot("lot-b", trial=2**20), ValueError, "trial: 1048576 is not"),
        (lambda: lotpilot.Episode("lot-b", trial=2**20), ValueError, "trial: 1048576 is not"),
        (lambda: lotpilot.Lot("lot-b", trial=-1), ValueError, "trial: -1 is not"),
        (lambda: lotpilot.Lot("lot-b", trial=2**70), ValueError, "within 0 … 1048575"),
        (lambda: lotpilot.Lot("lot-b", seed=-1), ValueError, "seed: -1 is not"),
        (lambda: lotpilot.Lot("lot-b", seed=2**70), ValueError, "seed: 1180591620717411303424 is not"),
        (lambda: lotpilot.Episode("lot-b").picture(-1), ValueError, "side_px: -1 is not"),
        (lambda: lotpilot.Episode("lot-b").picture(10**6), ValueError, "within 25 … 8192"),
        (lambda: lotpilot.load_round("no/such/run", -1), ValueError, "round: -1 is not"),
        (lambda: lotpilot.load_round("no/such/run", 2**70), ValueError, "within 0 … 1048575"),
        (lambda: lotpilot.generate("lot-b", count=0), ValueError, "count: 0 is not"),
        (lambda: lotpilot.generate("lot-b", count=2**31), ValueError, "within 1 … 1048575"),
        (lambda: lotpilot.evaluate("expert", "lot-b", trials=2**31), ValueError, "trials"),
        (lambda: lotpilot.evaluate("expert", "lot-b", trials=2**70), ValueError, "trials"),
        (lambda: Core(1, EnvOptions(threads=2**70), "disabled"), ValueError, "threads"),
        (lambda: Core(2, EnvOptions(threads=2**40), "disabled"), ValueError, "within 1 … 1024"),
        (lambda: Core(2**70, EnvOptions(), "disabled"), ValueError, "environments"),
        (lambda: Core(1, EnvOptions(), "disabled").reset(seeds=[2**70]), ValueError, "seed"),
        (lambda: Core(1, EnvOptions(), "disabled").reset(episodes=[-1]), ValueError, "episode: -1 is not"),
        (lambda: Core(1, EnvOptions(), "disabled").cars.route_points(np.nan), ValueError, "ahead_m: NaN"),
        (lambda: rust_loop(threads=0), ValueError, "within 1 … 1024"),
        (lambda: rust_loop(threads=10**6), ValueError, "within 1 … 1024"),
        (lambda: lotpilot.Episode("lot-b", seed=-1), ValueError, "seed: -1 is not"),
        (lambda: lotpilot.generate("lot-b", count=-1), ValueError, "count: -1 is not"),
        (lambda: lotpilot.evaluate("expert", "lot-b", trials=-1), ValueError, "trials: -1 is not"),
        (lambda: lotpilot.evaluate("expert", "lot-b", seed=2.5), ValueError, r"seed: 2\.5 is not"),
        (lambda: lotpilot.evaluate("exprt", "lot-b"), ValueError, "There are expert"),
        (lambda: lotpilot.evaluate(["expert", "expert"], "lot-b"), ValueError, "named twice"),
        (lambda: lotpilot.evaluate("expert", "lot-b", methods={"mine": ["a", "b", "c"]}), ValueError, "no driver is named"),
        (lambda: lotpilot.evaluate("expert", "lot-b", methods={"mine": "expert"}), ValueError, "at least 3 drivers"),
        (lambda: lotpilot.evaluate({"odd": 3}, "lot-b"), TypeError, "neither a name nor a function"),
        (lambda: lotpilot.evaluate({"a|b": "expert"}, "lot-b"), ValueError, r"contains '\|', and tables hold its name"),
        (lambda: lotpilot.load_round("no/such/run"), ValueError, "no such run"),
        (lambda: lotpilot.Dataset("no/such/run"), ValueError, "no round"),
        (lambda: EnvOptions(reward={"speed": 1.0}).weights(), ValueError, "there are progress"),
        (lambda: EnvOptions.of({"lot": "lot-a"}), TypeError, "there are lots"),
        (lambda: Core(0, EnvOptions(), "disabled"), ValueError, "0 environments"),
        (lambda: Core(10**9, EnvOptions(), "disabled"), ValueError, "environments are not within"),
        (lambda: Core(1, EnvOptions(trials=0), "disabled"), ValueError, "trials"),
        (lambda: Core(1, EnvOptions(lots=[]), "disabled"), ValueError, "no lots"),
        (lambda: Core(1, EnvOptions(threads=0), "disabled"), ValueError, "threads"),
        (lambda: Core(-1, EnvOptions(), "disabled"), ValueError, "environments: -1 is not"),
        (lambda: Core(1, EnvOptions(threads=-1), "disabled"), ValueError, "threads: -1 is not"),
    ],
)
def test_bad_input_is_one_clear_exception(make, error, part):
    with pytest.raises(error, match=part):
        make()


@pytest.mark.parametrize(
    ("actions", "part"),
    [
        ([[8.0, 0.0]], r"\(1, 2\), \(2, 2\) is needed"),
        ([8.0, 0.0], r"\(2,\), \(2, 2\) is needed"),
        ([[8.0, 0.0], [np.nan, 0.0]], "row 1 is .* not finite"),
        ([[np.inf, 0.0], [8.0, 0.0]], "row 0 is .* not finite"),
    ],
)
def test_wrong_actions_move_no_car(actions, part):
    core = Core(2, EnvOptions(lots=["lot-b"]), "next_step")
    before = core.reset().info.copy()
    with pytest.raises(ValueError, match=part):
        core.step(actions)
    after = core.reset(np.zeros(2, bool)).info
    np.testing.assert_array_equal(before, after)


def test_wrong_answers_of_a_function_are_raised_and_so_is_what_it_raises():
    def broken(grids):
        raise KeyError("weights")

    for driver, error, part in [
        (broken, KeyError, "weights"),
        (lambda grids: np.zeros((1, 3)), ValueError, "shape"),
        (lambda grids: np.full((len(grids), 2), np.nan), ValueError, "not a finite point"),
    ]:
        with pytest.raises(error, match=part):
            lotpilot.evaluate({"driver": driver}, "lot-b", trials=1)


def test_an_episode_is_neither_stepped_before_its_start_nor_after_its_end():
    episode = lotpilot.Episode("lot-b", overrides=SHORT)
    while not episode.is_over:
        episode.step([8.0, 0.0])
    with pytest.raises(lotpilot.EpisodeEnded, match="has ended"):
        episode.step([8.0, 0.0])
    core = Core(1, EnvOptions(), "next_step")
    with pytest.raises(lotpilot.EpisodeEnded, match="never reset"):
        core.step([[8.0, 0.0]])


def test_arrays_of_another_shape_or_type_are_refused():
    core = Core(2, EnvOptions(lots=["lot-b"]), "next_step")
    seen = core.reset()
    flags = np.zeros(2, bool)
    for broken, part in [
        ({"grids": np.zeros((2, 25, 24), np.uint8)}, "grids: the shape"),
        ({"grids": np.zeros((2, 25, 25), np.int64)}, "grids: not a numpy array of dtype uint8"),
        ({"info": seen.info[:, ::-1]}, "info: the array is not C-contiguous"),
    ]:
        wrong = type("Wrong", (), {**vars(seen), **broken})()
        with pytest.raises(ValueError, match=part):
            core.cars.step(np.zeros((2, 2), np.float32), wrong, np.zeros(2), flags, flags.copy(), None)


def _in_child(queue, threads):
    try:
        lots = ["lot-b", "test:1:lane", str(ROOT / "scenarios/examples/slalom.toml")]
        Core(6, EnvOptions(lots=lots, threads=threads), "next_step").reset()
        queue.put("drove")
    except RuntimeError as error:
        queue.put(str(error))


def test_a_forked_process_is_told_so_instead_of_waiting_forever():
    Core(4, EnvOptions(lots=["lot-b"]), "next_step").reset()
    # Whoever needs no threads but the caller's misses none, as PufferLib's processes, which are forked.
    for method, threads, part in [("fork", None, "was forked"), ("fork", 1, "drove"), ("spawn", None, "drove")]:
        context = multiprocessing.get_context(method)
        queue = context.Queue()
        child = context.Process(target=_in_child, args=(queue, threads))
        child.start()
        assert part in queue.get(timeout=60)
        child.join()


def test_threads_that_started_before_a_fork_are_not_waited_for():
    # Another process than this one, in which lotpilot has driven before.
    script = """
import os
from lotpilot.core import Core, EnvOptions

cars = Core(6, EnvOptions(lots=["lot-b"], threads=2), "next_step")
if os.fork() == 0:
    try:
        cars.reset()
    except RuntimeError as error:
        print(error, flush=True)
    os._exit(0)
os.wait()
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    assert "was forked" in done.stdout, done.stderr


def write_sums(folder):
    """Lists the files of a folder as storage does."""
    names = sorted(path.name for path in folder.iterdir() if path.is_file())
    lines = [f"{hashlib.sha256((folder / name).read_bytes()).hexdigest()}  {name}\n" for name in names]
    (folder / "sha256sums").write_text("".join(lines))


def write_round(run, number, grids, fractions):
    """A round of a run, as docs/formats.md describes it."""
    n, folder = len(grids), run / f"round-{number:02}"
    folder.mkdir()
    np.save(folder / "grids.npy", np.packbits(grids.reshape(n, -1), axis=1))
    np.save(folder / "labels.npy", np.column_stack([fractions, np.zeros(n)]).astype(np.float32))
    floats = ("time_s", "x_m", "y_m", "heading_rad", "speed_mps", "steering_rad", "command_steering_rad")
    columns = {name: np.arange(n, dtype=np.float32) for name in (*floats, "command_speed_mps")}
    ids = {"episode": np.zeros(n, np.uint32), "tick": np.arange(n, dtype=np.uint32)}
    np.savez(folder / "ticks.npz", **columns, **ids, driver=np.ones(n, np.uint8))
    (folder / "round.toml").write_text(
        f"schema = 2\nround = {number}\nsamples = {n}\nnoise_augmentations = 0\nticks = {n}\nnovice_ticks = 0\n"
        "tau_hat_sum = 0.0\ndriven_s = 0.1\nnear_collisions = 0\ndriven_m = 0.1\n"
        f'[[episodes]]\nlot = "lot-a"\ndirection = "forward"\nsamples = {n}\nnear_collisions = 0\ndriven_m = 0.1\n'
    )
    write_sums(folder)
    with open(run / "sha256sums", "a") as sums:
        list_of_round = hashlib.sha256((folder / "sha256sums").read_bytes()).hexdigest()
        sums.write(f"{list_of_round}  {folder.name}/sha256sums\n")


def test_no_round_of_training_data_is_lost_or_of_another_run(tmp_path):
    """The last round was left out without a word where it was gone, and one that was copied in was taken for the run's."""
    (tmp_path / "settings.toml").write_text(lotpilot.settings("smoke"))
    write_sums(tmp_path)
    for number in (0, 1):
        write_round(tmp_path, number, np.zeros((3, 25, 25), np.uint8), np.full((3, 2), 0.5, np.float32))
    shutil.copytree(tmp_path / "round-01", tmp_path / "round-02")
    for read in (lotpilot.Dataset, lambda run: lotpilot.load_round(run, 2)):
        with pytest.raises(ValueError, match="round-02: this run did not collect it"):
            read(tmp_path)
    shutil.rmtree(tmp_path / "round-02")
    assert len(lotpilot.Dataset(tmp_path)) == 6
    with pytest.raises(ValueError, match="there is no round 2"):
        lotpilot.load_round(tmp_path, 2)
    shutil.rmtree(tmp_path / "round-01")
    with pytest.raises(ValueError, match=r"round-01/sha256sums: cannot be read"):
        lotpilot.Dataset(tmp_path)


def test_rounds_of_training_data_are_read_and_damage_is_noticed(tmp_path):
    grids = np.random.default_rng(0).integers(0, 2, (3, 25, 25)).astype(np.uint8)
    fractions = np.array([[0.5, 1.0], [0.5, 0.0], [0.0, 0.5]], np.float32)
    (tmp_path / "settings.toml").write_text(lotpilot.settings("smoke"))
    write_sums(tmp_path)
    for number in (0, 1):
        write_round(tmp_path, number, grids, fractions)
    data = lotpilot.load_round(tmp_path, 1)
    np.testing.assert_array_equal(data["grids"], grids)
    np.testing.assert_allclose(data["points"], [[4.3, 0.0], [16.3, 0.0], [10.3, 6.0]], atol=1e-5)
    assert data["lots"] == ["lot-a"] and data["is_novice"].all() and data["tick"].tolist() == [0, 1, 2]
    dataset = lotpilot.Dataset(tmp_path)
    assert len(dataset) == 6 and dataset.columns()["round"].tolist() == [0, 0, 0, 1, 1, 1]
    damaged = tmp_path / "round-01" / "labels.npy"
    damaged.write_bytes(damaged.read_bytes()[:-1] + b"\x01")
    with pytest.raises(ValueError, match=r"labels\.npy"):
        lotpilot.Dataset(tmp_path)


def test_both_workspaces_have_the_same_profile_and_lints():
    own, root = (tomllib.loads((ROOT / path).read_text()) for path in ("python/Cargo.toml", "Cargo.toml"))
    assert own["lints"] == root["workspace"]["lints"]
    ours, theirs = own["profile"]["dev"], root["profile"]["dev"]
    packages, all_packages = ours.pop("package"), theirs.pop("package")
    assert ours == theirs
    members = [path.split("/")[-1] for path in root["workspace"]["members"]]
    for name, profile in packages.items():
        expected = all_packages.get(name, {})
        if name in members:
            expected = {"opt-level": theirs["opt-level"], "debug": theirs["debug"], **expected}
        assert profile == expected, name
