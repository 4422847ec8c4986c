"""One step of the rows of a tile, stage by stage, in the order in which the data flows.

    action -> thruster -> true motion -> measurement -> dropout -> Kalman filter -> reward, end -> observation

A file holds a stage: its scalar function, which works on row i of a tile (fields: see `kernel.tile`) with the settings
it needs (see `kernel.packing`), and the loop over the rows. The loops are compiled one by one, since LLVM does not
vectorise larger functions. The length of the tuple `width` says how many of the tile's rows are computed: numba
specialises on the type, so there is no run-time branch. A batch computes all LANES rows, a single environment one.
"""
