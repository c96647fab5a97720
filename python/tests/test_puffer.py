"""The adapter for PufferLib, held to the API of 3.0: with it if it is installed, else with a stand-in."""

import sys
import types

import gymnasium
import numpy as np
import pytest

SHORT = {"lots": ["lot-b"], "overrides": ["episode.metrics.timeout_s=2.0"]}


class StandIn:
    """What ``pufferlib.PufferEnv`` asks of an environment and does for it."""

    def __init__(self, buf=None):
        assert isinstance(self.single_observation_space, gymnasium.spaces.Box)
        assert isinstance(self.single_action_space, gymnasium.spaces.Box)
        assert self.num_agents >= 1
        # Spaces of all agents are PufferLib's to set.
        assert not hasattr(self, "observation_space") and not hasattr(self, "action_space")
        buf = buffers(self.num_agents) if buf is None else buf
        for name in ("observations", "rewards", "terminals", "truncations", "masks", "actions"):
            setattr(self, name, buf[name])


def buffers(n):
    return {
        "observations": np.zeros((n, 25, 25), np.uint8),
        "rewards": np.zeros(n, np.float32),
        "terminals": np.zeros(n, bool),
        "truncations": np.zeros(n, bool),
        "masks": np.ones(n, bool),
        "actions": np.zeros((n, 2), np.float32),
    }


@pytest.fixture
def puffer(monkeypatch):
    try:
        import pufferlib  # noqa: F401
    except ImportError:
        stand_in = types.ModuleType("pufferlib")
        stand_in.PufferEnv = StandIn
        monkeypatch.setitem(sys.modules, "pufferlib", stand_in)
    import lotpilot.puffer

    return lotpilot.puffer


def test_a_puffer_environment_writes_into_the_buffers_that_it_is_given(puffer):
    given = buffers(4)
    envs = puffer.LotPufferEnv(4, buf=given, **SHORT)
    assert envs.single_observation_space.shape == (25, 25) and envs.single_action_space.shape == (2,)
    observations, infos = envs.reset(seed=2)
    assert observations is given["observations"] and given["observations"].any() and infos == []
    first, ended = given["observations"].copy(), []
    for _ in range(45):
        observations, rewards, terminals, truncations, infos = envs.step(np.zeros((4, 2), np.float32))
        assert isinstance(infos, list) and len(infos) == (terminals | truncations).sum()
        ended += infos
    own = zip([observations, rewards, terminals, truncations], given.values(), strict=False)
    assert all(ours is theirs for ours, theirs in own)
    assert (given["observations"] != first).any() and given["rewards"].any()
    # All four run out of time at the 40th tick, and begin again in it.
    assert len(ended) == 4 and all(info["time_s"] == pytest.approx(2.0) for info in ended)
    envs.close()


def test_a_puffer_environment_drives_as_any_other(puffer):
    from lotpilot.core import Core, EnvOptions

    envs = puffer.LotPufferEnv(3, seed=5, **SHORT)
    core = Core(3, EnvOptions.of({"normalise": True, "seed": 5, **SHORT}), "same_step")
    observations, _ = envs.reset()
    np.testing.assert_array_equal(observations, core.reset().grids)
    rng = np.random.default_rng(0)
    for _ in range(50):
        actions = rng.uniform(-1, 1, (3, 2)).astype(np.float32)
        observations, rewards, terminals, truncations, _ = envs.step(actions)
        seen, expected, terminated, truncated, _ = core.step(actions)
        np.testing.assert_array_equal(observations, seen.grids)
        np.testing.assert_array_equal(rewards, expected.astype(np.float32))
        np.testing.assert_array_equal([terminals, truncations], [terminated, truncated])


def test_pufferlib_can_ask_how_to_show_what_is_rendered(puffer):
    """Its ``eval`` reads ``render_mode``, which its environments set themselves."""
    assert puffer.LotPufferEnv(1, **SHORT).render_mode is None
    envs = puffer.LotPufferEnv(2, render_mode="rgb_array", **SHORT)
    envs.reset(seed=1)
    assert envs.render_mode == "rgb_array" and envs.render().shape == (500, 1000, 3)
    with pytest.raises(ValueError, match="no render mode 'human'"):
        puffer.LotPufferEnv(1, render_mode="human", **SHORT)


def test_more_than_one_array_is_refused(puffer):
    with pytest.raises(ValueError, match="observe one array"):
        puffer.LotPufferEnv(2, state=True, **SHORT)


def test_pufferlib_steps_what_the_environments_step_alone():
    # As PufferLib holds its own environments to its backends (test_puffer_vectorization).
    pufferlib = pytest.importorskip("pufferlib")
    vector = pytest.importorskip("pufferlib.vector")
    from lotpilot.puffer import LotPufferEnv

    for backend, options in [(vector.Serial, {}), (vector.Multiprocessing, {"num_workers": 2})]:
        envs = vector.make(LotPufferEnv, env_kwargs={"num_envs": 3, **SHORT}, num_envs=2, backend=backend, **options)
        assert isinstance(envs.driver_env, pufferlib.PufferEnv)
        alone = [LotPufferEnv(3, buf=buffers(3), **SHORT) for _ in range(2)]
        found, _ = envs.reset(seed=1)
        expected = [env.reset(seed=1 + index)[0] for index, env in enumerate(alone)]
        np.testing.assert_array_equal(found, np.concatenate(expected))
        rng = np.random.default_rng(0)
        for _ in range(45):
            actions = rng.uniform(-1, 1, (6, 2)).astype(np.float32)
            stepped = [env.step(half)[:4] for env, half in zip(alone, np.split(actions, 2), strict=True)]
            for ours, theirs in zip(zip(*stepped, strict=True), envs.step(actions)[:4], strict=True):
                np.testing.assert_array_equal(theirs, np.concatenate(ours))
        envs.close()
