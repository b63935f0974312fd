"""Statistical core of a diagnosis: observations and candidates in, missing effects out.

Knows neither ROS nor this mechanism.  `diagnose` is the entry; `docs/diagnose-any-mechanism.md`
shows it on a plain table.
"""

from wrist_stiffness.diagnosis.candidates import Candidate, Parameter, ShapeParameter
from wrist_stiffness.diagnosis.compression import averaged, compress, dwell_groups
from wrist_stiffness.diagnosis.diagnose import diagnose
from wrist_stiffness.diagnosis.fitted import FittedModel, fit
from wrist_stiffness.diagnosis.nuisance import Nuisance
from wrist_stiffness.diagnosis.observations import Observations, Quantity
from wrist_stiffness.diagnosis.result import Diagnosis, Finding
from wrist_stiffness.diagnosis.settings import Settings

__all__ = [
    "Candidate",
    "Diagnosis",
    "Finding",
    "FittedModel",
    "Nuisance",
    "Observations",
    "Parameter",
    "Quantity",
    "Settings",
    "ShapeParameter",
    "averaged",
    "compress",
    "diagnose",
    "dwell_groups",
    "fit",
]
