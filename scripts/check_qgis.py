#!/usr/bin/python3
"""Opens objects.gpkg in a headless QGIS, as a user does, and checks that every layer is valid and has its style.

    scripts/check_qgis.py OUT/objects.gpkg [PICTURE.png]

Needs Debian's python3-qgis (and its Python); ends with 77 where that is missing. PICTURE gets the map as QGIS draws it.
"""

import os
import sys

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
try:
    from qgis.core import (
        Qgis,
        QgsApplication,
        QgsMapRendererSequentialJob,
        QgsMapSettings,
        QgsVectorLayer,
    )
    from qgis.PyQt.QtCore import QSize
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)

# Renderer and column of the labels of each layer, and the number of classes of the legend.
EXPECTED = {
    "bases": ("QgsCategorizedSymbolRenderer", None, 9),
    "objects": ("QgsCategorizedSymbolRenderer", "id", 9),
    "axis": ("QgsSingleSymbolRenderer", None, None),
    "tiles": ("QgsSingleSymbolRenderer", "tile", None),
}


def check(path, picture):
    told = []
    log = QgsApplication.messageLog()
    log.messageReceived.connect(lambda text, tag, level: told.append(f"{tag}: {text}") if level > Qgis.Info else None)
    layers = []
    for name, (renderer, label, classes) in EXPECTED.items():
        layer = QgsVectorLayer(f"{path}|layername={name}", name, "ogr")
        assert layer.isValid(), name
        # Without a style in the file, QGIS draws every layer with one symbol in a colour of its choice.
        _, found = layer.loadDefaultStyle()
        assert found, f"{name} has no default style"
        drawn = layer.renderer()
        assert type(drawn).__name__ == renderer, f"{name}: {type(drawn).__name__}"
        labels = layer.labeling().settings().fieldName if layer.labelsEnabled() else None
        assert labels == label, f"{name}: labelled by {labels}"
        if classes:
            assert drawn.classAttribute() == "class" and len(drawn.categories()) == classes, name
            colours = {category.symbol().color().name() for category in drawn.categories()}
            assert len(colours) == classes, f"{name}: {colours}"
        layers.append(layer)
    if picture:
        settings = QgsMapSettings()
        settings.setLayers(layers)
        settings.setDestinationCrs(layers[0].crs())
        settings.setOutputSize(QSize(1400, 700))
        extent = layers[1].extent()
        extent.scale(1.05)
        settings.setExtent(extent)
        job = QgsMapRendererSequentialJob(settings)
        job.start()
        job.waitForFinished()
        assert not job.errors(), [error.message for error in job.errors()]
        job.renderedImage().save(picture)
    assert not told, told
    print(f"QGIS {Qgis.QGIS_VERSION}: {layers[1].featureCount()} objects, every layer has its style")


def main():
    path, picture = sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else None
    program = QgsApplication([], False)
    program.initQgis()
    check(path, picture)
    program.exitQgis()


if __name__ == "__main__":
    main()
