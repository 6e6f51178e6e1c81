from .exercise import check as check
from .exercise import given as given
from .exercise import glossary as glossary
from .exercise import student as student
