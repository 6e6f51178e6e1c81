"""Field buses of a ship: AS-Interface, CAN, Modbus, and the papers that use them.

The package has floors, and imports go down only: `shipnet.papers` recomputes what the papers
print, `shipnet.design` turns points into cables and plans, `shipnet.asi` holds the bus itself.
Nothing here imports matplotlib or pandas until a figure or a table is asked for.
"""

__all__ = ["__version__"]

__version__ = "0.1.0"
