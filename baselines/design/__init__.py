"""Design of guidance and control laws: gains, reference paths and station keeping."""
