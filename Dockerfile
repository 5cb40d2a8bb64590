# The static program alone. Build it from the files of a release (`cargo xtask release`):
#     docker build --file Dockerfile target/release-files
# Run it on a folder of this machine:
#     docker run --rm --user "$(id -u):$(id -g)" --volume "$PWD:/data" papsynth generate --out fields --frames 8
FROM --platform=$BUILDPLATFORM debian:stable-slim AS files
RUN apt-get update && apt-get install --yes --no-install-recommends ca-certificates
ARG TARGETARCH=amd64
COPY papsynth-*-unknown-linux-musl.tar.gz /archives/
RUN processor=$(echo "$TARGETARCH" | sed 's/amd64/x86_64/; s/arm64/aarch64/') \
    && mkdir /papsynth && tar -xzf /archives/papsynth-*-"$processor"-*.tar.gz -C /papsynth --strip-components=1

FROM scratch
# Object stores need the certificates.
COPY --from=files /etc/ssl/certs/ca-certificates.crt /etc/ssl/certs/
COPY --from=files /papsynth/LICENSE-* /licences/
COPY --from=files /papsynth/papsynth /papsynth
WORKDIR /data
ENTRYPOINT ["/papsynth"]
