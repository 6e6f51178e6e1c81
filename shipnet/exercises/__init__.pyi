from .checking import check as check
from .checking import given as given
from .checking import glossary as glossary
from .exercise import student as student
