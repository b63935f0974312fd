"""The page of paper and model is made by a script beside the benchmarks."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[2] / "bench" / "paper_calibration"))
