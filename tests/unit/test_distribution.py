"""How tests are shared out among workers."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_a_file_stays_with_one_worker():
    files = ("tests/unit/test_kalman.py", "tests/unit/test_keys.py")
    command = [sys.executable, "-m", "pytest", "-n", "2", "--dist", "loadgroup", "-vv", *files]
    alone = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    done = subprocess.run(command, cwd=ROOT, env=alone, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout
    workers = set(re.findall(r"\[(gw\d)\].* (tests/\S+?\.py)::", done.stdout))
    assert {file for _, file in workers} == set(files)
    assert len(workers) == len(files)
