"""One likelihood, one search: which effects are in the data, and how sure that is.

Knows neither ROS nor this mechanism; `docs/inference.md` explains it.
"""

from wrist_stiffness.inference.answer import Diagnosis, Finding
from wrist_stiffness.inference.candidates import Candidate, Nuisance, Parameter, ShapeParameter
from wrist_stiffness.inference.observations import Observations, Quantity
from wrist_stiffness.inference.predictor import Predictor, load_predictor
from wrist_stiffness.inference.table_diagnosis import TableDiagnosis, diagnose

__all__ = [
    "Candidate",
    "Diagnosis",
    "Finding",
    "Nuisance",
    "Observations",
    "Parameter",
    "Predictor",
    "Quantity",
    "ShapeParameter",
    "TableDiagnosis",
    "diagnose",
    "load_predictor",
]
