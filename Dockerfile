# The course in JupyterLab, for one reader, from the exact versions in environment.txt:
#
#     docker build -t floatbase .
#     docker run --rm -p 127.0.0.1:8888:8888 -v floatbase:/home/learner/floatbase floatbase
#
# It prints an address to open. The reader's work is in the volume. A hub that starts containers needs this command instead:
# ["sh", "-c", "python -m floatbase.lessons.publish workspace --to floatbase; exec jupyterhub-singleuser"]
# the digest is that of 3.12.14 for all architectures
FROM python:3.12-slim@sha256:78387bc3881b8273120a12ebe6c1ab22b018ccc2c9adf565ae1ac9b536e184ea

# Code is compiled here for any processor of this architecture, so that the first start is as fast as the next.
ENV NUMBA_CPU_NAME=generic OPENBLAS_NUM_THREADS=1 PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1 PATH=/opt/venv/bin:$PATH
# predictions and answers are kept with the lessons, in the volume; the settings are those of `floatbase lab`
ENV FLOATBASE_HOME=/home/learner/floatbase/.floatbase JUPYTER_CONFIG_PATH=/opt/floatbase/floatbase/lessons/jupyter

# Pinocchio needs libgomp1, which the slim image lacks
RUN apt-get update && apt-get install -y --no-install-recommends libgomp1 && rm -rf /var/lib/apt/lists/*
RUN useradd --create-home --uid 1000 learner && install -d -o learner /home/learner/floatbase
COPY . /opt/floatbase
WORKDIR /opt/floatbase
RUN python -m venv /opt/venv \
    && pip install -q -c environment.txt hatchling editables \
    && pip install -q -c environment.txt --no-build-isolation -e ".[hub]"
RUN floatbase compile

# the reader can read everything above, but not write to it
USER learner
WORKDIR /home/learner
EXPOSE 8888
CMD ["floatbase", "lab", "floatbase", "--ip=0.0.0.0", "--no-browser"]
