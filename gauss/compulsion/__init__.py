"""The hinge between mechanics and solvers: the compulsion, its pattern, and certified solutions."""

from gauss.compulsion.compulsion import Compulsion
from gauss.compulsion.dual import DualCertificate
from gauss.compulsion.solution import Answer, Certificate, Solution, Status
from gauss.compulsion.structure import Constraint, Edge, Structure

__all__ = ["Answer", "Certificate", "Compulsion", "Constraint", "DualCertificate", "Edge", "Solution", "Status", "Structure"]
