# Runs the demo: docker build --tag socialnav_mj . && docker run --rm socialnav_mj
FROM python:3.12-slim-bookworm

# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install --no-install-recommends --yes make \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --create-home user

USER user
WORKDIR /home/user/socialnav_mj
COPY --chown=user:user . .
RUN make install

CMD ["make", "demo"]
