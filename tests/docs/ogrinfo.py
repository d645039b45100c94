"""What `ogrinfo` of GDAL does for the pages, by the GDAL in pyogrio: `ogrinfo SOURCE LAYER -where FILTER`."""

import sys

import pyogrio

source, layer, _where, condition = sys.argv[1:]
about, _, shapes, _ = pyogrio.raw.read(source, layer=layer, where=condition)
print(f"Layer name: {layer}\nFeature Count: {len(shapes)}\n{' '.join(about['fields'])}")
