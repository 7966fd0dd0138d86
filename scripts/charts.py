"""Charts as SVG whose bytes repeat, for the scripts that draw one beside their tables."""


def plots():
    """matplotlib.pyplot, or None where it is absent, which is said."""
    try:
        import matplotlib
    except ImportError as missing:
        print(f"no drawing: {missing}")
        return None
    matplotlib.use("svg")
    matplotlib.rcParams["svg.hashsalt"] = "chainage"
    import matplotlib.pyplot
    return matplotlib.pyplot


def save(figure, path):
    """Writes the chart without the date."""
    figure.savefig(path, metadata={"Date": None})
