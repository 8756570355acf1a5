"""A campaign that is stopped from outside: one signal ends it at once, and every finished landing is kept."""

import signal
import subprocess
import sys
import time
from dataclasses import replace

from shipland.evaluation.campaign import CampaignPlan, run_campaign
from shipland.scenario.scenario import load_scenario


def test_a_campaign_that_is_stopped_keeps_what_was_flown_and_goes_on(tmp_path):
    out = tmp_path / "out"
    plan = CampaignPlan(load_scenario("near", time_limit_s=3.0), "paper", "geometric", range(1, 61), out, 1, False)
    words = ["campaign", "--scenario", "near", "--pilot", "paper", "--count", "60", "--set", "time_limit_s=3.0"]
    words += ["--out", str(out), "--workers"]
    for how, workers in ((signal.SIGINT, 2), (signal.SIGTERM, 1)):
        before = _rows(out)
        command = [sys.executable, "-m", "shipland.cli", *words, str(workers)]
        with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
            try:
                while _rows(out) < before + 2:
                    assert process.poll() is None, process.stderr.read()
                    time.sleep(0.05)
                process.send_signal(how)
                code = process.wait(60.0)
            finally:
                process.kill()
            said = process.stderr.read()
        assert code == 130
        assert "interrupted" in said
        assert "Traceback" not in said
        assert _rows(out) >= before + 2
    flown = list(run_campaign(replace(plan, seeds=[1, 2])))
    assert len(flown) == 2


def _rows(out):
    path = out / "landings.csv"
    return len(path.read_text().splitlines()) - 1 if path.exists() else 0
