"""Workers that are killed in the middle of something."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CUT_RESULT = """
import os, struct, sys, time
from pathlib import Path
from fab.workers import worker_pool

def begin_a_result(mark):
    pipe = sys._getframe(1).f_locals["result_queue"]._writer
    os.write(pipe.fileno(), struct.pack("!i", 1000) + b"the first bytes of a thousand")
    Path(mark).touch()
    time.sleep(600)

mark = Path(sys.argv[1])
try:
    with worker_pool(2) as pool:
        pool.submit(begin_a_result, str(mark))
        while not mark.exists():
            time.sleep(0.05)
        raise KeyboardInterrupt
except KeyboardInterrupt:
    print("ended")
"""


def test_an_interruption_while_a_worker_writes_its_result_ends(tmp_path):
    command = [sys.executable, "-c", CUT_RESULT, str(tmp_path / "begun")]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert (run.stdout, run.returncode) == ("ended\n", 0)
