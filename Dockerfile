# One image for the service and the simulated robot; docker-compose.yml runs it twice.
FROM python:3.12-slim-bookworm

# gcc compiles the solver kernel once (without it the service runs the slower virtual machine); the GL libraries draw
# the simulator's pictures off screen.
RUN apt-get update \
    && apt-get install -y --no-install-recommends gcc libc6-dev libegl1 libgl1-mesa-dri libosmesa6 \
    && rm -rf /var/lib/apt/lists/*

WORKDIR /app
COPY pyproject.toml README.md LICENSE NOTICE ./
COPY proto ./proto
COPY ik_service ./ik_service
COPY clients ./clients
COPY sim_client ./sim_client
RUN pip install --no-cache-dir ".[all]" && useradd --create-home ik && install -d -o ik /out

USER ik
ENV OMP_NUM_THREADS=1 MUJOCO_GL=egl
EXPOSE 12345 7447
# The kernel takes some ten seconds to compile: here rather than at the first start. On another processor it is compiled
# again, then and there.
RUN ik-service info

# On loopback until it is told otherwise. An address outside the container wants IK_TOKEN: docs/access.md.
HEALTHCHECK --interval=5s --timeout=3s --start-period=60s \
    CMD ["ik-service", "healthcheck"]
CMD ["ik-service", "serve"]
