import pickle
import runpy
from pathlib import Path

import numpy as np
import pytest

from simulator.dataset.builder import make_dataset, plan_dataset
from simulator.dataset.task_runner import Workers

CONFIG = """
base = "point_scatterers"
count = 5
set.base_station.elements = 8
set.radio.points = 8
set."users.ann.position_m" = [0.2, 0.5]
[vary]
"users.ann.position_m" = { kind = "in_box", low_m = [0.1, 0.3], high_m = [0.3, 0.6] }
"""


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dataset")
    (folder / "config.toml").write_text(CONFIG, encoding="utf-8")
    job = plan_dataset(folder / "config.toml", folder / "it.zarr")
    make_dataset(job, workers=Workers(processes=0))
    return folder / "it.zarr"


def test_the_example_reads_every_sample_without_pytorch(store: Path) -> None:
    script = Path(__file__).parents[1] / "examples" / "dataset_in_pytorch.py"
    names = runpy.run_path(str(script))
    samples = names["Samples"](store)
    assert len(samples) == len(list(samples)) == 5
    assert samples[3]["echo"].shape == (8, 8)
    assert samples[3]["uplink"].shape == (1, 8, 8)
    places = np.array([sample["user_position"][0, :2] for sample in samples])
    assert np.all((places >= [0.1, 0.3]) & (places <= [0.3, 0.6]))
    assert len(np.unique(places[:, 0])) == 5
    with pytest.raises(IndexError):
        samples[5]
    order = list(names["shuffled_by_block"](samples, seed=1))
    assert sorted(order) == list(range(5))
    state = pickle.loads(pickle.dumps(samples.__getstate__()))
    assert state["_root"] is None  # each process opens the store by itself
