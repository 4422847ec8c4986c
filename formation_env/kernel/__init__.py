"""The compiled step: one function a stage, single and batched alike."""
