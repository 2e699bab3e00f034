# Runs the demo: docker build --tag socialnav_mj . && docker run --rm socialnav_mj
FROM python:3.12-slim-bookworm

# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install --no-install-recommends --yes make \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --create-home --uid 1000 user

USER 1000
WORKDIR /home/user/socialnav_mj
COPY --chown=1000:1000 . .
RUN make install

CMD ["make", "demo"]
