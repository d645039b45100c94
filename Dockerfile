FROM python:3.11-slim AS build
WORKDIR /src
COPY requirements/run.lock requirements/run.lock
RUN pip install --no-cache-dir --require-hashes -r requirements/run.lock
COPY . .
RUN pip wheel --no-cache-dir --no-deps --no-build-isolation --wheel-dir /dist .

FROM python:3.11-slim
COPY requirements/run.lock /tmp/run.lock
RUN pip install --no-cache-dir --require-hashes -r /tmp/run.lock && rm /tmp/run.lock
COPY --from=build /dist/*.whl /tmp/
RUN pip install --no-cache-dir --no-deps /tmp/outcrop-*.whl && rm /tmp/*.whl \
    && useradd --create-home outcrop && mkdir -p -m 700 /var/lib/outcrop /keys /heads && chown outcrop /var/lib/outcrop /keys /heads
USER outcrop
ENV OUTCROP_DATA_DIR=/var/lib/outcrop NUMBA_CACHE_DIR=/var/lib/outcrop/numba
EXPOSE 8000
CMD ["outcrop", "serve", "--host", "0.0.0.0", "--port", "8000"]
