"""Charts as SVG with reproducible bytes, for the scripts that draw one beside their tables."""


def plots():
    """matplotlib.pyplot, or None with a message if it is absent."""
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
