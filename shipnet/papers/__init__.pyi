from .items import PrintedTable as PrintedTable
from .items import figure as figure
from .items import table as table
from .judging import PAPERS as PAPERS
from .judging import Claim as Claim
from .judging import Ledger as Ledger
from .judging import ledger as ledger
from .judging import show as show
