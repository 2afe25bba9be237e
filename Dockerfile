# On a CPU:
#   docker build -t warpdribble .
#   docker run --rm --user $(id -u) -v warp:/cache -v "$PWD:/here" warpdribble demo
# With networks to learn:  docker build --build-arg EXTRAS='[learn,gym,onnx]' -t warpdribble .
FROM python:3.13-slim AS wheel
COPY . /src
RUN pip wheel --no-deps --wheel-dir /dist /src

FROM python:3.13-slim
ARG EXTRAS=""
# Torch from its own index is built for CPUs; the other gigabytes would be of no use here.
RUN --mount=from=wheel,source=/dist,target=/dist \
    pip install --no-cache-dir --extra-index-url https://download.pytorch.org/whl/cpu "$(ls /dist/*.whl)$EXTRAS"
# Kernels are compiled for the processor that runs them, so at the first run: keep /cache.
RUN mkdir -m 777 /cache
ENV WARP_CACHE_PATH=/cache HOME=/tmp
WORKDIR /here
ENTRYPOINT ["warpdribble"]
