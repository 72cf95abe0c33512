"""Table I of the paper, simulation."""

from dropanchor_evaluation.paper import table1
from dropanchor_evaluation.paper.tuning import RELEASED, STATED, base, run, search, tuned
from dropanchor_tag_client.simulator.sensors import preset
from dropanchor_tag_client.simulator.simulation import simulate


def test_the_picture_of_the_paper_returns_at_the_noise_of_its_data_and_not_at_the_noise_it_states() -> None:
    calls: list[None] = []
    section = table1.run(progress=lambda: calls.append(None), seeds=range(3))
    assert len(calls) == table1.RUNS_PER_SEED * 3
    released, stated = section.results["released"], section.results["stated"]
    assert 2.0 < released["vanilla EKF, the authors' parameters"]["mean"] < 2.5
    assert 0.5 < released["Algorithm 1, the authors' parameters"]["mean"] < 0.9
    assert stated["vanilla EKF, the authors' parameters"]["mean"] > 20.0
    assert stated["Algorithm 1, the authors' parameters"]["mean"] > 3.0
    assert stated["Algorithm 1, tuned parameters"]["mean"] < 0.5
    assert stated["fleet"]["mean"] < stated["Algorithm 1, the authors' parameters"]["mean"] / 5


def test_the_search_is_seeded_and_never_worse_than_its_starting_point_on_its_own_seeds() -> None:
    found = search(RELEASED, speed_estimator=False, candidates=3)
    assert found == search(RELEASED, speed_estimator=False, candidates=3)
    simulation = simulate("P", 1000, preset("released"))
    assert run(simulation, tuned(RELEASED, False), False)[1].mean() < run(simulation, base(RELEASED), False)[1].mean()
    assert tuned(STATED, True).th_distance != base(STATED).th_distance
