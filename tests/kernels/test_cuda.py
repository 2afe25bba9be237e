"""The CUDA path: it compiles without a device, and gives the CPU's results on one."""

import numpy as np
import pytest
import warp as wp

from warpdribble import kernels
from warpdribble.sims import Model, Simulation


@pytest.mark.parametrize("module", ["step", "observe", "exchange", "character"])
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


@pytest.mark.gpu
def test_cuda_agrees_with_cpu():
    """A second of standing; both are float32, and contract multiplications differently."""
    model = Model.load("player")
    out = []
    for device in ("cpu", "cuda"):
        sim = Simulation(model, 8, device=device)
        sim.step(100)
        assert (sim.status == 0).all()
        out.append(sim.joint_q.copy())
    np.testing.assert_allclose(out[1], out[0], atol=1e-4)


@pytest.mark.gpu
def test_a_walk_on_cuda_agrees_with_the_cpu():
    """A shipped policy over ten fragments, worlds copied in between: targets along tables, what is felt, and
    the copies, on both devices."""
    from warpdribble.learning.runs.folder import Run

    run = Run.load("dribble-right-authored")
    felt = []
    for device in ("cpu", "cuda"):
        task = run.task(12, device)
        k = np.arange(12)
        seen = task.reset(k, run.graph.start_q[k], run.graph.start_qd[k])
        task.sim.apply_force("torso", [20.0, 0.0, 0.0], worlds=[3, 5])
        for row in range(10):
            seen = task.advance(k, run.policy.act(task.state(seen, k), k))
            if row == 4:
                sources = np.array([0, 0, 2, 3, 3, 5, 6, 7, 8, 9, 11, 10])
                task.sim.copy_worlds(sources)
                seen, k = seen[sources], k[sources]
            k = task.graph.follow(k, np.random.default_rng(0))
        felt.append(seen)
    np.testing.assert_allclose(felt[1], felt[0], atol=1e-2, rtol=1e-2)
