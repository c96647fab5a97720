"""Gymnasium's own checks, its vector environments, and Stable-Baselines3 where it is installed."""

import warnings
from importlib.metadata import entry_points

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

import lotpilot
from lotpilot.gym import LotVectorEnv

SHORT = {"lots": ["lot-b"], "overrides": ["episode.metrics.timeout_s=2.0"]}
STRAIGHT = np.array([8.0, 0.0], np.float32)


@pytest.mark.parametrize("options", [{}, {"state": True, "view": True, "action": "steering"}, {"normalise": True}])
def test_gymnasium_finds_nothing_wrong(options):
    env = gymnasium.make("lotpilot/Lot-v0", **SHORT, **options)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        if not options:
            # Box bounds in metres, not -1 … 1, are what is asked for.
            warnings.filterwarnings("ignore", message=".*action space.*")
        warnings.filterwarnings("ignore", message=".*normalized space.*")
        check_env(env.unwrapped, skip_render_check=True)


def test_gymnasium_before_1_0_can_be_imported_first():
    # It imports what is named here while it is itself half imported.
    plugins = entry_points(group="gymnasium.envs")
    assert [plugin.value for plugin in plugins if plugin.value.startswith("lotpilot")] == []


def test_spaces_are_in_metres():
    env = gymnasium.make("lotpilot/Lot-v0")
    np.testing.assert_allclose(env.action_space.low, [4.3, -6.0], atol=1e-6)
    np.testing.assert_allclose(env.action_space.high, [16.3, 6.0], atol=1e-6)
    steering = gymnasium.make("lotpilot/Lot-v0", action="steering")
    np.testing.assert_allclose(steering.action_space.high, [np.radians(35.5), 2.2], atol=1e-6)


def test_a_seed_names_the_episode_and_the_command_line_knows_it():
    env = gymnasium.make("lotpilot/Lot-v0", lots=["lot-a", "lot-b"])
    first, info = env.reset(seed=5)
    assert {name: info[name] for name in ("lot", "direction", "trial", "seed")} == {
        "lot": "lot-a",
        "direction": "forward",
        "trial": 0,
        "seed": 5,
    }
    _, info = env.reset()
    assert (info["lot"], info["direction"], info["episode_number"]) == ("lot-a", "reverse", 1)
    with pytest.raises(ValueError, match="it is 'episode'"):
        env.reset(options={"episodes": [11]})
    _, info = env.reset(options={"episode": 11})
    assert (info["lot"], info["direction"], info["trial"]) == ("lot-b", "reverse", 2)
    again, _ = env.reset(seed=5)
    np.testing.assert_array_equal(first, again)


def test_what_is_observed_stays_what_it_was():
    env = gymnasium.make("lotpilot/Lot-v0", **SHORT)
    first, _ = env.reset(seed=1)
    kept = first.copy()
    for _ in range(20):
        env.step(STRAIGHT)
    np.testing.assert_array_equal(first, kept)


def test_the_view_is_what_the_grid_is_made_of():
    env = gymnasium.make("lotpilot/Lot-v0", lots=["lot-b"], noise="clean", view=True, state=True)
    observed, _ = env.reset(seed=1)
    for _ in range(5):
        pooled = observed["view"].reshape(25, 8, 25, 8).max(axis=(1, 3))
        np.testing.assert_array_equal(pooled, observed["grid"])
        observed, *_ = env.step(STRAIGHT)
    assert observed["state"][0] > 0


def test_an_episode_ends_where_the_settings_say():
    env = gymnasium.make("lotpilot/Lot-v0", **SHORT)
    env.reset(seed=1)
    ends = [env.step(STRAIGHT)[2:4] for _ in range(40)]
    assert ends[-1] == (False, True) and set(ends[:-1]) == {(False, False)}, "40 ticks of 50 ms"
    with pytest.raises(lotpilot.EpisodeEnded):
        env.step(STRAIGHT)
    first = gymnasium.make("lotpilot/Lot-v0", lots=["lot-b"], overrides=["episode.metrics.events_max=1"])
    first.reset(seed=1)
    while True:
        *_, terminated, truncated, info = first.step(STRAIGHT)
        if terminated or truncated:
            break
    assert terminated and info["near_collisions"] == 1 and info["event"] == 1


def test_pictures_show_the_lot_and_the_grid():
    env = gymnasium.make("lotpilot/Lot-v0", **SHORT, render_mode="rgb_array")
    env.reset(seed=1)
    before = env.render()
    for _ in range(30):
        env.step(STRAIGHT)
    after = env.render()
    assert before.shape == after.shape == (500, 1000, 3) and before.dtype == np.uint8
    assert (before != after).mean() > 0.01


@pytest.mark.parametrize("threads", [1, 2])
def test_many_environments_drive_as_each_alone(threads):
    """Vector environments, whatever the threads, have the observations and rewards of single ones."""
    count = 5
    envs = gymnasium.make_vec(
        "lotpilot/Lot-v0", count, vectorization_mode="vector_entry_point", **SHORT, state=True, threads=threads
    )
    singles = [gymnasium.make("lotpilot/Lot-v0", **SHORT, state=True) for _ in range(count)]
    observed, _ = envs.reset(seed=3)
    for index, single in enumerate(singles):
        single.reset(seed=3, options={"episode": index})
    rng = np.random.default_rng(0)
    for _ in range(40):
        actions = np.stack([rng.uniform(5, 9, count), rng.uniform(-2, 2, count)], axis=1)
        observed, rewards, terminated, truncated, infos = envs.step(actions)
        for index, single in enumerate(singles):
            alone, reward, *ended, info = single.step(actions[index])
            np.testing.assert_array_equal(observed["grid"][index], alone["grid"])
            np.testing.assert_array_equal(observed["state"][index], alone["state"])
            assert rewards[index] == reward and [terminated[index], truncated[index]] == ended
            assert infos["safe_ratio"][index] == info["safe_ratio"]
    assert truncated.all()


def test_the_next_episode_begins_when_the_mode_says():
    def driven(mode, steps=90):
        envs = LotVectorEnv(2, autoreset_mode=mode, **SHORT)
        assert envs.metadata["autoreset_mode"] == mode
        envs.reset(seed=1)
        return [envs.step(np.tile(STRAIGHT, (2, 1))) for _ in range(steps)]

    later = driven(AutoresetMode.NEXT_STEP)
    assert [index for index, step in enumerate(later) if step[3].any()] == [39, 80]
    assert later[39][4]["episode_number"].tolist() == [0, 1] and later[40][4]["episode_number"].tolist() == [2, 3]
    assert later[40][1].tolist() == [0.0, 0.0] and not later[40][3].any()
    at_once = driven(AutoresetMode.SAME_STEP)
    assert [index for index, step in enumerate(at_once) if step[3].any()] == [39, 79]
    infos = at_once[39][4]
    assert infos["episode_number"].tolist() == [2, 3] and infos["final_info"]["episode_number"].tolist() == [0, 1]
    np.testing.assert_array_equal(infos["final_obs"][0], later[39][0][0])
    np.testing.assert_array_equal(at_once[39][0], later[40][0])
    with pytest.raises(lotpilot.EpisodeEnded):
        driven(AutoresetMode.DISABLED)
    envs = LotVectorEnv(2, autoreset_mode="Disabled", **SHORT)
    envs.reset(seed=1)
    envs.step(np.tile(STRAIGHT, (2, 1)))
    with pytest.raises(ValueError, match="it is 'episodes'"):
        envs.reset(options={"episode": 3})
    _, infos = envs.reset(options={"reset_mask": np.array([False, True])})
    assert infos["episode_number"].tolist() == [0, 3] and infos["time_s"].tolist() == [pytest.approx(0.05), 0.0]


def test_environments_without_a_seed_go_on():
    envs = LotVectorEnv(2, **SHORT)
    envs.reset(seed=1)
    _, infos = envs.reset(seed=[None, 5])
    assert infos["episode_number"].tolist() == [2, 1]
    assert [envs.core.place(index)["seed"] for index in range(2)] == [1, 5]
    with pytest.raises(ValueError, match="3 values for 2"):
        envs.reset(seed=[None, 5, 6])


def test_the_expert_labels_what_anyone_drives():
    envs = LotVectorEnv(3, lots=["lot-b", "lot-c"], normalise=True)
    envs.reset(seed=1)
    labels = envs.expert_actions()
    assert labels.shape == (3, 2) and (np.abs(labels) <= 1.5).all()
    # The first car drives the first trial of lot b, forward.
    low, high = np.array([4.3, -6.0]), np.array([16.3, 6.0])
    alone = lotpilot.Episode("lot-b").expert_action()
    np.testing.assert_allclose(low + 0.5 * (labels[0] + 1.0) * (high - low), alone, atol=1e-4)
    assert (envs.route_points(6.0)[:, 0] > 4).all()


def test_stable_baselines_finds_nothing_wrong():
    pytest.importorskip("stable_baselines3")
    from stable_baselines3 import PPO
    from stable_baselines3.common.env_checker import check_env as check
    from stable_baselines3.common.vec_env import VecMonitor

    from lotpilot.sb3 import LotVecEnv

    check(gymnasium.make("lotpilot/Lot-v0", **SHORT, normalise=True), skip_render_check=True)
    envs = LotVecEnv(4, **SHORT)
    assert envs.metadata["render_fps"] == 20
    envs.seed(2)
    envs.reset()
    assert envs.env_method("expert_action", indices=[1])[0].shape == (2,)
    ended = []
    for _ in range(45):
        _, _, dones, infos = envs.step(np.zeros((4, 2)))
        ended += [info for info, done in zip(infos, dones, strict=True) if done]
    assert len(ended) == 4
    assert all(info["TimeLimit.truncated"] and info["terminal_observation"].shape == (25, 25) for info in ended)
    PPO("MlpPolicy", VecMonitor(envs), n_steps=64, batch_size=64, n_epochs=1).learn(256)


def test_stable_baselines_starts_the_episodes_that_options_name():
    pytest.importorskip("stable_baselines3")
    from lotpilot.sb3 import LotVecEnv

    envs = LotVecEnv(3, **SHORT)
    envs.seed(5)
    envs.set_options({"episode": 11})
    envs.reset()
    assert [info["episode_number"] for info in envs.reset_infos] == [11, 11, 11]
    # Those of one reset; whoever is named none goes on.
    envs.set_options([{"episode": 7}, {}, {"episode": 2}])
    envs.reset()
    assert [info["episode_number"] for info in envs.reset_infos] == [7, 14, 2]
    envs.reset()
    assert [info["episode_number"] for info in envs.reset_infos] == [10, 17, 5]
    envs.set_options({"episodes": [1, 2, 3]})
    with pytest.raises(ValueError, match="it is 'episode'"):
        envs.reset()


def test_stable_baselines_is_given_no_arrays_that_are_overwritten():
    # Its algorithms store an observation after the next step, as off a tape that had been recorded over.
    pytest.importorskip("stable_baselines3")
    from lotpilot.sb3 import LotVecEnv

    envs = LotVecEnv(2, **SHORT)
    first = envs.reset()
    kept = first.copy()
    for _ in range(20):
        envs.step(np.zeros((2, 2)))
    np.testing.assert_array_equal(first, kept)
    with pytest.raises(ValueError, match="copy: SB3 stores"):
        LotVecEnv(2, copy=False, **SHORT)


@pytest.mark.parametrize("seed", [-1, 2**70, 2.5])
def test_a_seed_out_of_range_is_a_value_error_everywhere(seed):
    with pytest.raises(ValueError, match=r"seed: .* is not a whole number"):
        gymnasium.make("lotpilot/Lot-v0", **SHORT).unwrapped.reset(seed=seed)
    envs = LotVectorEnv(2, **SHORT)
    for given in ([1, seed], seed, np.array([1, seed])):
        with pytest.raises(ValueError, match=r"seed: .* is not a whole number"):
            envs.reset(seed=given)


@pytest.mark.parametrize(
    ("seed", "expected"),
    [
        (np.int64(5), [5, 5]),
        (np.array(5), [5, 5]),
        (np.array([5, 7], np.uint32), [5, 7]),
        ((np.int64(5), None), [5, 1]),
        (range(5, 7), [5, 6]),
    ],
)
def test_seeds_may_be_numbers_of_numpy(seed, expected):
    envs = LotVectorEnv(2, **SHORT)
    envs.reset(seed=1)
    envs.reset(seed=seed)
    assert [envs.core.place(index)["seed"] for index in range(2)] == expected
    if isinstance(seed, np.integer):
        env = gymnasium.make("lotpilot/Lot-v0", **SHORT).unwrapped
        assert env.reset(seed=seed)[1]["seed"] == seed and env.np_random_seed == seed
