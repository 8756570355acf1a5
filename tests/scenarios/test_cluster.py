"""The bench on a Ray cluster of two machines, one of which dies half-way: every flight is flown and counts once."""

from types import SimpleNamespace

import pytest

from shipland.errors import ConfigError, DataError
from shipland.evaluation import cluster as clusters
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


def test_a_machine_with_another_pilot_of_that_name_is_refused(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))
    own = tmp_path / "lent_pilot.py"

    def there(fly, flight):
        own.write_text("from shipland.guidance.pilot import paper\n# an older one\n")
        done = fly(flight)
        own.write_text("from shipland.guidance.pilot import paper\n")
        return done

    def remote(fly):
        return SimpleNamespace(remote=lambda flight: lambda: there(fly, flight))

    ray = SimpleNamespace(
        init=lambda **_: None, shutdown=lambda: None, cancel=lambda *_, **__: None, get=lambda given: given(),
        cluster_resources=lambda: {"CPU": 1}, remote=lambda **_: remote, wait=lambda given, **_: (given[:1], []),
    )  # fmt: skip
    ray.exceptions = SimpleNamespace(RayError=OSError)
    monkeypatch.setitem(__import__("sys").modules, "ray", ray)
    monkeypatch.setattr(clusters, "require", lambda *_: None)
    monkeypatch.setattr(clusters, "land_quietly", lambda _: None)
    own.write_text("from shipland.guidance.pilot import paper\n")
    cells = cells_of((SuiteEntry(("rig-natops",)),), Overrides(("lent_pilot:paper",)))
    with (
        open_campaign(CampaignPlan(cells, range(1, 3), tmp_path / "out")) as bench,
        pytest.raises(DataError, match="has other own pilot or vision code than this one"),
    ):
        list(bench.fly(cluster("auto")))


def test_without_ray_one_line_says_what_to_install(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "ray", None)
    with pytest.raises(ConfigError, match=r"shipland\[cluster\]"):
        cluster("auto")
