import numpy as np
import pytest

from warpdribble import simulate as job
from warpdribble.clips.bvh import ClipError
from warpdribble.sims import Model, Simulation
from warpdribble.sims.authored.dribble import dribble_right
from warpdribble.sims.model import pose
from warpdribble.sims.reference.reference import Cycle, Reference, close_cycle
from warpdribble.sims.worlds.simulation import NONFINITE


@pytest.fixture(scope="module")
def player():
    return Model.load("player")


@pytest.fixture(scope="module")
def simulation(player):
    return Simulation(player, world_count=job.TRIES)


@pytest.fixture(scope="module", params=["free", "tracked"])
def run(request, player, simulation):
    clip = dribble_right(player)
    reference = Cycle(clip.reference).repeat(player, 4)
    ball = job.ball_in_reference(player, clip.reference)
    return job.simulate(simulation, reference, request.param, ball)


def test_the_player_follows_the_dribble_on_its_feet(run):
    assert run.falls == 0
    assert np.degrees(run.angle_error.mean()) < 2.0
    assert run.position_error.mean() < 0.02
    assert run.contacts["right foot down"].mean() > 0.95
    assert run.contacts["left foot down"].mean() > 0.95


def test_the_ball_is_in_play(run, player):
    height = run.body_q[:, player.body("ball"), 2]
    bounces = (height[1:-1] < height[:-2]) & (height[1:-1] <= height[2:]) & (height[1:-1] < 0.25)
    assert bounces.sum() >= 2
    assert height.min() > 0.1
    assert run.contacts["ball on ground"].any()
    assert run.contacts["ball on right hand"].any()


def test_the_same_job_gives_the_same_result(player, simulation):
    clip = dribble_right(player)
    ball = job.ball_in_reference(player, clip.reference)
    first, second = (job.simulate(simulation, clip.reference, "free", ball) for _ in range(2))
    assert np.array_equal(first.body_q, second.body_q)


def test_a_recorded_dribble_is_tracked(mocap, player, simulation):
    reference, _ = job.load_clip(player, mocap / "cmu" / "06_12.bvh", (597, 684))
    reference = close_cycle(player, reference).repeat(player, 3)
    hand = job.dribbling_hand(player, reference)
    assert hand == "r_hand"
    ball = job.ball_from_hand(player, reference, hand)
    run = job.simulate(simulation, reference, "tracked", ball)
    assert run.falls == 0
    assert np.degrees(run.angle_error.mean()) < 3.0
    assert run.position_error.mean() < 0.03


def test_the_dribbling_hand_is_told(mocap, player):
    reference, _ = job.load_clip(player, mocap / "cmu" / "06_04.bvh", (118, 241))
    assert job.dribbling_hand(player, reference) == "l_hand"


def test_a_ball_starts_under_the_palm(cmu_clip, player):
    reference, _ = job.load_clip(player, cmu_clip)
    ball = job.ball_from_hand(player, reference, "r_hand")
    palm = pose.forward(player, reference.joint_q)[0, player.body("r_hand"), :3]
    assert np.linalg.norm(ball.position - palm) < 0.25
    assert ball.position[2] > 0.1193


def test_a_ball_from_a_low_hand_comes_back_to_it(player):
    clip = dribble_right(player)
    low = np.roll(clip.reference.joint_q[:-1], -round(clip.lowest / player.timestep), axis=0)
    ball = job.ball_from_hand(player, Reference(low, player.timestep), "r_hand")
    fall = ball.position[2] - 0.1193
    impact = np.sqrt(ball.velocity[2] ** 2 + 2 * 9.81 * fall)
    assert ball.velocity[2] < 0.0
    assert (0.8 * impact) ** 2 > 2 * 9.81 * fall


def test_a_state_that_breaks_down_is_said(player):
    class Broken:
        model, world_count = player, 2
        joint_q = np.full((2, player.nq), np.nan)
        status = np.full(2, NONFINITE)
        body_q = np.zeros((2, player.nbody, 7))

        def __getattr__(self, name):
            return lambda *_, **__: None

    reference = dribble_right(player).reference
    with pytest.raises(FloatingPointError, match="broke down"):
        job.simulate(Broken(), reference)


@pytest.mark.parametrize("frames", [(5, 5), (9, 3), (-3, 50), (0, 121), (200, 300)])
def test_frames_that_are_not_there_are_refused(cmu_clip, player, frames):
    with pytest.raises(ClipError, match="--frames"):
        job.load_clip(player, cmu_clip, frames)


def test_joints_that_are_not_there_are_named(cmu_clip, player):
    cmu_clip.write_text(cmu_clip.read_text().replace("LeftFoot", "LFoot"))
    with pytest.raises(ClipError, match=r"unknown joints.*LeftFoot"):
        job.load_clip(player, cmu_clip)


def test_a_bounce_between_two_frames_counts_as_contact():
    gap = np.array([0.30, 0.21, 0.12, 0.03, 0.04, 0.11, 0.18])
    assert job._touches(gap).tolist() == [False] * 3 + [True] + [False] * 3
    hover = np.array([0.05, 0.0499, 0.05])
    assert not job._touches(hover).any()
