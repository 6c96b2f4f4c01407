// Roams slowly and turns away from what the front sonar sees; prints where it is.
//
// Wiring: the robot's serial port has RS-232 levels. Through a MAX3232 to the UART
// named below: DE-9 pin 2 (robot sends) to RX, pin 3 (robot receives) to TX, pin 5
// to GND. Put the robot on blocks first.

#include <P2OSClient.h>

#define ROBOT_PORT Serial1

P2OSClient robot(ROBOT_PORT);
unsigned long printedAt = 0;

void setup() {
  Serial.begin(115200);
  ROBOT_PORT.begin(9600);
  robot.connect();
}

void loop() {
  robot.update();
  if (robot.isOpen()) {
    // The two sonars in the middle look ahead; -1 is not known yet.
    const float left = robot.sonar(3), right = robot.sonar(4);
    const bool isFree = left > 600 && right > 600;
    robot.drive(isFree ? 150 : 0, isFree ? 0 : 30);
  }
  if (millis() - printedAt >= 1000) {
    printedAt = millis();
    Serial.print(robot.isOpen() ? robot.subclass() : "not connected");
    Serial.print("  x ");
    Serial.print(robot.x());
    Serial.print(" mm, y ");
    Serial.print(robot.y());
    Serial.print(" mm, heading ");
    Serial.print(robot.heading());
    Serial.print(" deg, battery ");
    Serial.print(robot.battery());
    Serial.println(" V");
  }
}
