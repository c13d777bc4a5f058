"""GPUs without one: cuda-bindings calls a stub of the driver, which is stricter than a driver has to be."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

SUPPORT = Path(__file__).parents[1] / "support"


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a compiler of C")
def test_cuda_bindings_drive_a_stub_of_the_driver(tmp_path):
    pytest.importorskip("cuda.bindings.driver", reason="needs cuda-bindings")
    library = tmp_path / "libcuda.so.1"
    subprocess.run(["cc", "-shared", "-fPIC", "-o", library, SUPPORT / "libcuda_stub.c", "-ldl"], check=True)
    root = str(SUPPORT.parents[1])
    paths = {
        "LD_LIBRARY_PATH": os.pathsep.join(filter(None, [str(tmp_path), os.environ.get("LD_LIBRARY_PATH")])),
        "PYTHONPATH": os.pathsep.join(filter(None, [root, os.environ.get("PYTHONPATH")])),
        "GAUSS_CACHE": "",
    }
    command = [sys.executable, "-m", "tests.support.cuda_stub"]
    done = subprocess.run(command, env=os.environ | paths, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0 and "all checks passed" in done.stdout, done.stderr[-4000:]
