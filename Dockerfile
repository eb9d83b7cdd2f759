# All of deeptruck beside ROS 2 Jazzy, whose rclpy the nodes then use:
#   docker build -t deeptruck .
#   docker run --rm -it -v "$PWD:/data" deeptruck deeptruck-simulation --simulator truck:trucksim --policy baseline:acc --record drive
# Without a GPU, --build-arg TORCH_INDEX=URL of PyTorch's CPU package index saves gigabytes.
FROM ros:jazzy

RUN apt-get update \
 && apt-get install -y --no-install-recommends python3-venv \
 && rm -rf /var/lib/apt/lists/*
RUN python3 -m venv /opt/deeptruck
ENV PATH=/opt/deeptruck/bin:$PATH

WORKDIR /opt/source
COPY pyproject.toml constraints.txt README.md LICENSE ./
COPY src src
COPY exam exam
COPY ros2_ws/src ros2_ws/src
ARG TORCH_INDEX=
RUN pip install --no-cache-dir ${TORCH_INDEX:+--extra-index-url $TORCH_INDEX} -c constraints.txt ".[all,fmu]" ./exam

# The base image's entry point sources ROS 2 before each command.
WORKDIR /data
CMD ["deeptruck-simulation", "--help"]
