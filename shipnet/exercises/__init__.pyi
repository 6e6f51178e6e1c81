from .checking import Verdict as Verdict
from .checking import check as check
from .checking import given as given
from .students import Student as Student
from .students import student as student
from .words import glossary as glossary
