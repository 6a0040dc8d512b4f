# agentflow as a command: docker build -t agentflow . && docker run agentflow design --task throwing
FROM python:3.11-slim AS build
COPY . /src
RUN pip wheel --no-cache-dir --no-deps --wheel-dir /wheels /src

FROM python:3.11-slim
COPY --from=build /wheels /wheels
RUN pip install --no-cache-dir /wheels/*.whl
RUN useradd --create-home agentflow
USER agentflow
WORKDIR /home/agentflow
ENTRYPOINT ["agentflow"]
