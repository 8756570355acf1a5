"""The bench on a Ray cluster of two machines, one of which dies half-way: every flight is flown and counts once."""

import pytest

from shipland.errors import ConfigError
from shipland.evaluation.campaign import CampaignPlan, open_campaign, processes, read_cells
from shipland.evaluation.cluster import cluster
from shipland.evaluation.suite import Overrides, SuiteEntry, cells_of

FLIGHTS = 8


@pytest.fixture
def plan(tmp_path):
    entries = (SuiteEntry(("rig-natops",), ("time_limit_s=3.0",)),)
    return CampaignPlan(cells_of(entries, Overrides(("paper",))), range(1, FLIGHTS + 1), tmp_path / "out")


@pytest.mark.filterwarnings("ignore")  # Ray's own
def test_a_machine_that_dies_costs_nothing(plan, tmp_path):
    pytest.importorskip("ray", reason="wants Ray: pip install 'shipland[cluster]'")
    from ray.cluster_utils import Cluster

    machines = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    try:
        second = machines.add_node(num_cpus=1)
        machines.wait_for_nodes()
        with open_campaign(plan) as bench:
            for count, _ in enumerate(bench.fly(cluster(machines.address)), start=1):
                if count == 2:
                    machines.remove_node(second, allow_graceful=False)
            assert bench.lost == []
        assert count == FLIGHTS
    finally:
        machines.shutdown()
    (there,) = read_cells([plan.out])
    assert [it.seed for it in there.landings] == list(plan.seeds)
    assert len((plan.out / there.name / "landings.csv").read_text().splitlines()) == 1 + FLIGHTS
    assert sorted(int(path.stem) for path in there.logs.glob("*.mcap")) == list(plan.seeds)  # nobody lands in 3 s
    here = CampaignPlan(plan.cells, plan.seeds, tmp_path / "here")
    with open_campaign(here) as bench:
        list(bench.fly(processes(1)))
    (alone,) = read_cells([here.out])
    assert str(alone.landings) == str(there.landings)  # NaN is not equal to itself; its text is


def test_without_ray_one_line_says_what_to_install(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "ray", None)
    with pytest.raises(ConfigError, match=r"shipland\[cluster\]"):
        cluster("auto")
