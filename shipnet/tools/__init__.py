"""Interactive tools: for each a pure `update`, which computes, and a thin view of widgets."""

__all__: list[str] = []
