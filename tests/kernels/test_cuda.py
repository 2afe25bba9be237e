"""The CUDA path: it compiles without a device, and gives the CPU's results on one."""

import pickle
from pathlib import Path

import numpy as np
import pytest
import warp as wp

from warpdribble import kernels
from warpdribble.learning import STAGES, RandomWalk, Rollout, Run, Streams
from warpdribble.sims import Model, Simulation
from warpdribble.sims.worlds import Course, Group, Probe, State, Watch, terms
from warpdribble.sims.worlds.watch import first, gap, height_of, last, least, most, total, trouble

DEVICES = ["cpu", pytest.param("cuda", marks=pytest.mark.gpu)]
"""On a CPU these tests compare it with itself: what they say is right where there is no GPU, too."""


@pytest.mark.parametrize("module", ["film", "step", "loose", "observe", "place", "port", "probe"])
def test_compiles_for_sm_90(module, tmp_path):
    wp.init()
    if not wp.is_cuda_available() and not nvrtc():
        pytest.skip("this build of Warp has no NVRTC to compile CUDA with")
    wp.compile_aot_module(kernels.program(1, module), arch=90, module_dir=tmp_path)
    files = [f for f in tmp_path.rglob("*") if f.suffix in (".ptx", ".cubin")]
    assert len(files) == 1 and files[0].stat().st_size > 10_000
    if files[0].suffix == ".ptx":
        assert ".target sm_90" in files[0].read_text()


def nvrtc() -> bool:
    """Whether Warp carries a CUDA compiler, whatever devices there are."""
    return bool(wp._src.context.runtime.nvrtc_supported_archs)


def test_every_module_with_kernels_is_compiled():
    """By the test above."""
    folder = Path(kernels.__file__).parent
    found = {f.stem for f in folder.glob("*.py") if "@wp.kernel" in f.read_text(encoding="utf-8")}
    (mark,) = test_compiles_for_sm_90.pytestmark
    assert found == set(mark.args[1])


@pytest.fixture(scope="module")
def model():
    return Model.load("player")


@pytest.mark.gpu
def test_cuda_agrees_with_cpu(model):
    """A second of standing; both are float32, and contract multiplications differently."""
    out = []
    for device in ("cpu", "cuda"):
        sim = Simulation(model, 8, device=device)
        sim.step(100)
        assert (sim.status == 0).all()
        out.append(sim.joint_q.copy())
    np.testing.assert_allclose(out[1], out[0], atol=1e-4)


def walk(device):
    """What is felt after a shipped policy went ten fragments in twelve worlds, two of them pushed, and copied
    in between."""
    learned = Run.load("dribble-right-authored").learned(STAGES, "locomotion")
    task = learned.task(12, device)
    streams = Streams([np.random.default_rng(0)], 12)
    rollout = Rollout(task, learned.controller, RandomWalk(streams), learned.starts.draw(streams))
    for fragment in rollout.fragments(10):
        task.course.push[[3, 5], 0] = [20.0, 0.0, 0.0]
        assert not fragment.failed.any()
        if fragment.row == 4:
            rollout.become(np.array([0, 0, 2, 3, 3, 5, 6, 7, 8, 9, 11, 10]))
    return task.felt


@pytest.mark.parametrize("device", DEVICES)
def test_a_walk_agrees_with_the_cpu(device):
    """Targets along tables, offsets, pushes, what is felt, and the copies, on both devices."""
    np.testing.assert_allclose(walk(device), walk("cpu"), atol=1e-2, rtol=1e-2)


def edge(model, device):
    """What crosses the edge of three worlds in ten steps: observations and their cost, what was watched, and
    the coordinates."""
    random = np.random.default_rng(1)
    sim = Simulation(model, 3, device=device)
    targets = np.tile(model.start_q, (12, 1))
    course = Course(sim, targets, ("l_hip", {"r_index_pip": 1.0, "r_index_dip": 0.5}), ("torso", "r_hand"))
    course.offset[:] = 0.2 * random.standard_normal((3, 4))
    course.push[:] = random.uniform(-20, 20, (3, 2, 3))
    of = {
        "foot": terms.point("l_foot"),
        "miss": terms.miss(("neck", "l_hip")),
        "momentum": terms.momentum(),
        "way": terms.between("r_palm", "ball"),
        "ball": terms.ballistic("ball", 0.12, 0.9, 0.8),
    }
    probe = Probe(
        sim, of, (targets, np.zeros((12, model.nv))), [Group("foot", 2.0), Group("miss", 1.0, (1, 2))]
    )
    probe.want(random.random((12, probe.size)))
    near, weight = gap("r_palm", "ball", 0.12), random.random(12)
    watched = {"near": least(near), "far": most(near, weight), "sum": total(near, weight)}
    at_end = np.arange(12) == 7
    watched |= {"top": last(height_of("ball"), at_end), "bad": first(trouble())}
    watch = Watch(sim, watched, 12)
    course.step(5, [0, 3, 7], watch)
    felt, cost = probe.judge([0, 1, 2])
    seen = watch.read()
    course.calm()
    course.step(5, [1, 2, 3])
    return felt, cost, seen, sim.joint_q, sim.bodies()[0]


@pytest.mark.parametrize("device", DEVICES)
def test_what_crosses_the_edge_agrees_with_the_cpu(model, device):
    for a, b in zip(edge(model, device), edge(model, "cpu")):
        np.testing.assert_allclose(a, b, atol=2e-3, rtol=1e-3)


@pytest.mark.parametrize("device", DEVICES)
def test_states_go_from_device_to_device(model, device):
    """Bit for bit: as they are, by rows, and through a file."""
    here, there = Simulation(model, 5), Simulation(model, 5, device=device)
    here.step(10)
    state = here.state()
    there.place(state)
    for back in (
        there.state(),
        pickle.loads(pickle.dumps(there.state())),
        there.state().select(np.arange(5)),
    ):
        for name in state.names:
            np.testing.assert_array_equal(back[name], state[name], err_msg=name)
        here.reset()
        here.place(back, [4, 3, -1, 1, 0])
        np.testing.assert_array_equal(here.joint_q[[0, 1, 3, 4]], state.joint_q[[4, 3, 1, 0]])
    there.place(State.of(model, model.start_q), [-1, 0, -1, -1, 0])
    np.testing.assert_array_equal(there.joint_q[[0, 2, 3]], state.joint_q[[0, 2, 3]])
    assert not there.contacts().impulse[[1, 4]].any()
    there.copy_worlds([1, 1, 0, 4, 4])
    np.testing.assert_array_equal(there.joint_q[2], state.joint_q[0])


@pytest.mark.parametrize("device", DEVICES)
def test_tensors_are_live_on_the_device(model, device):
    torch = pytest.importorskip("torch", reason="torch is an optional extra: learn")
    if device == "cuda" and not torch.cuda.is_available():
        pytest.skip("this build of torch has no CUDA")
    sim = Simulation(model, 3, device=device)
    q, qd = sim.torch.joint_q, sim.torch.joint_qd
    assert q.device.type == device and q.shape == (3, model.nq)
    q[1, 0], qd[1, 0] = 0.25, 1.0
    np.testing.assert_array_equal(sim.joint_q[:, 0], [0.0, 0.25, 0.0])
    sim.step()
    assert sim.joint_q[1, 0] > 0.25
    wp.synchronize()
    np.testing.assert_array_equal(q.cpu().numpy(), sim.joint_q)
    sim.reset([1])
    np.testing.assert_array_equal(q.cpu().numpy(), sim.joint_q)
