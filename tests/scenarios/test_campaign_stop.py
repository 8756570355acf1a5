"""A campaign that is stopped from outside: one signal ends it at once, and every finished landing is kept."""

import signal
import subprocess
import sys
import time
from dataclasses import replace

import pytest

from shipland.missions.campaign import CampaignPlan, run_campaign
from shipland.missions.scenarios import load_scenario


@pytest.mark.parametrize(("how", "workers"), [(signal.SIGINT, 2), (signal.SIGTERM, 2), (signal.SIGINT, 1)])
def test_a_stopped_campaign_keeps_what_was_flown(tmp_path, how, workers):
    out = tmp_path / "out"
    request = CampaignPlan(load_scenario("near"), "paper", "geometric", range(1, 61), out, workers, False)
    words = ["campaign", "--scenario", "near", "--pilot", "paper", "--count", "60", "--workers", str(workers)]
    command = [sys.executable, "-m", "shipland.cli", *words, "--out", str(request.out)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        try:
            while _rows(request) < 2:
                assert process.poll() is None, process.stderr.read()
                time.sleep(0.1)
            asked_s = time.monotonic()
            process.send_signal(how)
            code = process.wait(60.0)
            print(f"{how.name}: stopped {time.monotonic() - asked_s:.2f} s after the signal")
        finally:
            process.kill()
        said = process.stderr.read()
    assert code == 130
    assert "interrupted" in said
    assert "Traceback" not in said
    rows = _rows(request)
    flown = list(run_campaign(replace(request, seeds=[1, 2], workers=1)))
    assert len(flown) == 2
    assert rows >= 2


def _rows(request):
    path = request.out / "landings.csv"
    return len(path.read_text().splitlines()) - 1 if path.exists() else 0
